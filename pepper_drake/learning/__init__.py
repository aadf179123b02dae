"""Demonstrations to movement primitives, as plain functions and dataclasses."""
