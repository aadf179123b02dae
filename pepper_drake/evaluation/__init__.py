"""Accuracy of perception and of approximators against the truth."""
