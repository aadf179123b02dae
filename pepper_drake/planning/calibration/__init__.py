"""Postures in which a robot is calibrated."""
