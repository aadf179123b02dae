"""Demonstrations: recording, files, alignment."""
