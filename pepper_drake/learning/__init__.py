"""Demonstrations to movement primitives, as plain functions and dataclasses."""

from pepper_drake.learning.demonstration import TORSO_HEIGHT, Demonstration

__all__ = ["TORSO_HEIGHT", "Demonstration"]
