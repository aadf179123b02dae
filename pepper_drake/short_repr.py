"""Views of objects of many numbers: a line of text, and in a notebook a figure."""

import importlib
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any

import numpy as np

_LONGEST = 60
"""Longer texts of fields are cut."""
_WHOLE = 220
"""The fields that make the text longer than this are counted only."""


def short_repr(self: Any) -> str:
    """Returns a line for a dataclass: plain fields by value, arrays by shape, others by class.

    Fields that have their default are left out. Use it in a class: `__repr__ = short_repr`.
    """
    parts = [
        f"{field.name}={_short(getattr(self, field.name))}"
        for field in fields(self)
        if field.repr and not _is_default(field, getattr(self, field.name))
    ]
    shown = parts
    while len(shown) > 1 and sum(map(len, shown)) + 2 * len(shown) > _WHOLE:
        shown = shown[:-1]
    if len(shown) < len(parts):
        shown = [*shown, f"… {len(parts) - len(shown)} more"]
    return f"{type(self).__name__}({', '.join(shown)})"


def figure_view(self: Any) -> str:
    """Returns HTML with the object's figure, as notebooks ask for it.

    Use it in a class that `reporting.notebook_view` draws: `_repr_html_ = figure_view`.
    """
    # Only now: a figure needs matplotlib, and rooms that are above the object's own.
    view = importlib.import_module("pepper_drake.reporting.notebook_view")
    html: str = view.html_of(self)
    return html


def _is_default(field: Field[Any], value: Any) -> bool:
    if field.default is not MISSING:
        default = field.default
    elif field.default_factory is not MISSING:
        default = field.default_factory()
    else:
        return False
    if isinstance(value, np.ndarray) or isinstance(default, np.ndarray):
        return bool(np.array_equal(value, default))
    try:
        return bool(value == default)
    except ValueError:  # Arrays within compare to arrays.
        return False


def _short(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size > 4:
        return f"array{value.shape}"
    if is_dataclass(value) and not isinstance(value, type):
        return f"{type(value).__name__}(…)"
    text = repr(value)
    if isinstance(value, list | tuple | dict) and len(text) > _LONGEST:
        return f"{type(value).__name__} of {len(value)}"
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"
