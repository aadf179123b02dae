"""Fault injection between ports."""
