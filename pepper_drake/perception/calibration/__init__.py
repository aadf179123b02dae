"""Calibration of joints and cameras by a marker on the hand."""
