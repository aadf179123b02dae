"""Faults that are put between two ports, to see what comes of them."""
