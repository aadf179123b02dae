"""Evaluation of perception, approximators and faults against the ground truth."""
