"""Views of large objects: a line of text, a signature, and a figure in notebooks."""

import importlib
import inspect
import re
from dataclasses import MISSING, Field, fields, is_dataclass
from typing import Any

import numpy as np

_LONGEST = 60
"""Longer texts of fields are cut."""
_WHOLE = 220
"""Fields that would make the text longer than this are only counted."""


def short_repr(self: Any) -> str:
    """Returns a line for a dataclass: plain fields by value, arrays by shape, others by class.

    Fields with their default value are left out. Use it in a class: `__repr__ = short_repr`.
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


class _BareName:
    """An annotation that `help()` prints as it is."""

    def __init__(self, text: str) -> None:
        self._text = text

    def __repr__(self) -> str:
        return self._text


def shortened(function: Any) -> inspect.Signature:
    """Returns the signature of a constructor for `help()`, without `self`.

    Types are named without their modules, and left out where the default implies them.
    """
    parameters = list(inspect.signature(function).parameters.values())[1:]
    return inspect.Signature([_without_modules(parameter) for parameter in parameters])


class _ShortSignature:
    """Computes a dataclass's signature on demand."""

    def __get__(self, instance: Any, owner: Any) -> inspect.Signature:
        return shortened(owner.__init__)


def _without_modules(parameter: inspect.Parameter) -> inspect.Parameter:
    if isinstance(parameter.default, bool | int | float | str):
        return parameter.replace(annotation=parameter.empty)  # The default implies the type.
    kind = parameter.annotation
    text = kind if isinstance(kind, str) else inspect.formatannotation(kind)
    return parameter.replace(annotation=_BareName(re.sub(r"(\w+\.)+", "", text)))


short_signature = _ShortSignature()
"""Signature by `shortened`. Use it in a dataclass: `__signature__ = short_signature`."""


def figure_view(self: Any) -> str:
    """Returns HTML with the object's figure, for notebooks.

    Use it in a class that `reporting.notebook_view` draws: `_repr_html_ = figure_view`.
    """
    # Imported here: a figure needs matplotlib, and a room above the object's own.
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
    except ValueError:  # Nested arrays compare to arrays.
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
