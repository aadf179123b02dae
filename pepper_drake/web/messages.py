"""Messages that browsers send to a live page: checked, clamped and written anew."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import msgpack

MESSAGE_LIMIT = 4096
"""Largest message of a browser [bytes]; a game pad's has fewer than 1000."""

_MOST_PADS, _MOST_AXES = 64, 64


class BadMessageError(ValueError):
    """A message that no page of ours sends."""


@dataclass(frozen=True)
class SliderChange:
    """A slider of the page was moved.

    Attributes:
        name: The slider's label.
        value: Within its range.
    """

    name: str
    value: float


@dataclass(frozen=True)
class ButtonPress:
    """A button of the page was pressed.

    Attributes:
        name: The button's label.
    """

    name: str


@dataclass(frozen=True)
class GamepadChange:
    """Something on a game pad was moved, or it was plugged in or out.

    Attributes:
        index: Number of the pad; None if there is none.
        axes: From -1 to 1.
        buttons: From 0 to 1.
    """

    index: int | None = None
    axes: tuple[float, ...] = ()
    buttons: tuple[float, ...] = ()


Message = SliderChange | ButtonPress | GamepadChange


def read_message(data: bytes | str, controls: Mapping[str, Mapping[str, Any]]) -> Message | None:
    """Reads what a browser sent.

    Args:
        data: The websocket's message.
        controls: The page's controls, as their `set_control` messages say.

    Returns:
        The message; None if it is harmless and nothing comes of it.

    Raises:
        BadMessageError: It is none of the messages that Drake's page sends.
    """
    fields = unpack(data)
    kind, name = fields.get("type"), fields.get("name", "")
    if not isinstance(name, str):
        raise BadMessageError("a name that is no text")
    if kind == "camera_pose":
        return None
    if kind == "gamepad":
        return read_gamepad(fields.get("gamepad"))
    if kind not in ("button", "slider"):
        raise BadMessageError("an unknown type")
    value = number(fields.get("value")) if kind == "slider" else None
    control = controls.get(name)
    if control is None:  # It went while somebody pressed it.
        return None
    is_slider = "min" in control
    if is_slider != (kind == "slider"):
        raise BadMessageError(f"a {kind} that is none")
    if value is None:
        return ButtonPress(name)
    return SliderChange(name, min(max(value, control["min"]), control["max"]))


def pack_message(message: Message) -> bytes:
    """Returns a message as Drake's Meshcat reads it."""
    if isinstance(message, ButtonPress):
        fields: dict[str, Any] = {"type": "button", "name": message.name}
    elif isinstance(message, SliderChange):
        fields = {"type": "slider", "name": message.name, "value": message.value}
    else:
        pad: dict[str, Any] = {}
        if message.index is not None:
            pad = {
                "index": message.index,
                "button_values": message.buttons,
                "axes": message.axes,
            }
        fields = {"type": "gamepad", "name": "", "gamepad": pad}
    packed: bytes = msgpack.packb(fields)
    return packed


def unpack(data: bytes | str) -> dict[Any, Any]:
    """Reads a message's map.

    Raises:
        BadMessageError: It is no map, or too long.
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
    """Reads what a browser says of a game pad: `index`, `axes` and `button_values`.

    Raises:
        BadMessageError: It makes no sense.
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
    """Returns a finite number.

    Raises:
        BadMessageError: It is none.
    """
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise BadMessageError("no finite number")
    return float(value)
