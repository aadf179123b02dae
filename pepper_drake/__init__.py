"""Pepper learns to reach: movement primitives, cameras and Drake in one diagram."""
