"""Pepper learns to reach: movement primitives, cameras and Drake in one diagram."""

from pepper_drake import _former_names

_former_names.install()
