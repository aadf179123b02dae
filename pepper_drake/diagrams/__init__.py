"""Diagrams: the station, and the applications built on it."""
