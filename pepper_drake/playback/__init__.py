"""Playback of what was recorded: runs, demonstrations and primitives, from their files alone."""
