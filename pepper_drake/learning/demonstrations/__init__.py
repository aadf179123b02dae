"""Demonstrations: recording, files of many kinds, checking, alignment."""
