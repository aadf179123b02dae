"""Demonstrations: files of many kinds, what was recorded, and whether it can be right."""
