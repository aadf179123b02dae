"""Playback of recorded runs, demonstrations and primitives, from their files alone."""
