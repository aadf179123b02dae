"""Regressions of the forcing term: one interface, several methods."""
