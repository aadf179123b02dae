"""Calibration of joints and cameras with a marker on the hand."""
