"""Gaze: aiming of the head and view planning."""
