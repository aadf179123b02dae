"""A short text for objects of many numbers: shapes in place of arrays, names of what is inside."""

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

_LONGEST = 60
"""Longer texts of fields are cut."""


def short_repr(self: Any) -> str:
    """Returns a line for a dataclass: plain fields by value, arrays by shape, others by class.

    Use it in a class: `__repr__ = short_repr`.
    """
    parts = (f"{field.name}={_short(getattr(self, field.name))}" for field in fields(self))
    return f"{type(self).__name__}({', '.join(parts)})"


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size > 4:
        return f"array{value.shape}"
    if is_dataclass(value) and not isinstance(value, type):
        return f"{type(value).__name__}(…)"
    text = repr(value)
    if isinstance(value, list | tuple | dict) and len(text) > _LONGEST:
        return f"{type(value).__name__} of {len(value)}"
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
