"""Diagrams built of the systems: the station and what is done with it."""
