"""Checks and clamps messages from browsers to the teaching page."""

import math
from dataclasses import dataclass
from typing import Any

import msgpack

MESSAGE_LIMIT = 4096
"""Largest message from a browser [bytes]; a gamepad's has fewer than 1000."""

_MOST_PADS, _MOST_AXES = 64, 64


class BadMessageError(ValueError):
    """A message that none of our pages sends."""


@dataclass(frozen=True)
class GamepadChange:
    """New state of a gamepad that was moved, plugged in or unplugged.

    Attributes:
        index: Number of the gamepad; None if there is none.
        axes: Values from -1 to 1.
        buttons: Values from 0 to 1.
    """

    index: int | None = None
    axes: tuple[float, ...] = ()
    buttons: tuple[float, ...] = ()


def unpack(data: bytes | str) -> dict[Any, Any]:
    """Reads the map of a message.

    Raises:
        BadMessageError: It is not a map, or too long.
    """
    if isinstance(data, str):
        raise BadMessageError("a text")
    if len(data) > MESSAGE_LIMIT:
        raise BadMessageError("too long")
    try:
        fields = msgpack.unpackb(data, strict_map_key=True)
    except (ValueError, RecursionError, msgpack.UnpackException):
        raise BadMessageError("no msgpack") from None
    if not isinstance(fields, dict):
        raise BadMessageError("no map")
    return fields


def read_gamepad(pad: object) -> GamepadChange:
    """Reads a browser's gamepad message: `index`, `axes` and `button_values`.

    Raises:
        BadMessageError: It is malformed.
    """
    if not isinstance(pad, dict):
        raise BadMessageError("no game pad")
    index = pad.get("index")
    if index is None:
        return GamepadChange()
    if type(index) is not int or not 0 <= index < _MOST_PADS:
        raise BadMessageError("an index that is none")
    return GamepadChange(
        index,
        axes=_numbers(pad.get("axes"), -1.0),
        buttons=_numbers(pad.get("button_values"), 0.0),
    )


def _numbers(values: object, lower: float) -> tuple[float, ...]:
    if not isinstance(values, list) or len(values) > _MOST_AXES:
        raise BadMessageError("no list of numbers")
    return tuple(min(max(number(value), lower), 1.0) for value in values)


def number(value: object) -> float:
    """Returns a value as a finite number.

    Raises:
        BadMessageError: It is not one.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise BadMessageError("no finite number")
    return float(value)
