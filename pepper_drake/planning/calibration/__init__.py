"""Planning of calibration postures."""
