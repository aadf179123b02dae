"""Checks, clamps and re-encodes messages from browsers to a viser page."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import msgpack

from pepper_drake.web.messages import BadMessageError, number, unpack

_FARTHEST = 10.0
"""Limit of the coordinates of dragged objects [m]."""
_LONGEST_TEXT = 200
_MOST_NUMBERS = 8
_SIZE = 100_000
"""Largest size of a browser's window [pixels]."""

_Field = Callable[[Any], Any]


def _text(value: object) -> str:
    if not isinstance(value, str) or len(value) > _LONGEST_TEXT:
        raise BadMessageError("a text that is none, or too long")
    return value


def _vector(size: int, farthest: float = 1e6) -> _Field:
    def read(value: object) -> list[float]:
        if not isinstance(value, list) or len(value) != size:
            raise BadMessageError("a vector of another size")
        return [min(max(number(entry), -farthest), farthest) for entry in value]

    return read


def _quaternion(value: object) -> list[float]:
    wxyz = _vector(4)(value)
    norm = math.hypot(*wxyz)
    if not 0.5 < norm < 2.0:
        raise BadMessageError("a quaternion that is no rotation")
    return [entry / norm for entry in wxyz]


def _pixels(value: object) -> int:
    return int(min(max(number(value), 1.0), _SIZE))


def _one_of(*values: object) -> _Field:
    def read(value: object) -> object:
        if isinstance(value, list | dict) or value not in values:
            raise BadMessageError("an unknown word")
        return value

    return read


def _optional(field: _Field) -> _Field:
    return lambda value: None if value is None else field(value)


def _value(value: object) -> object:
    if isinstance(value, bool):
        return value
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list):
        if len(value) > _MOST_NUMBERS:
            raise BadMessageError("too many numbers")
        return [number(entry) for entry in value]
    number(value)
    return value


def _updates(value: object) -> dict[str, Any]:
    if not isinstance(value, dict) or list(value) != ["value"]:
        raise BadMessageError("a change of something else than a value")
    return {"value": _value(value["value"])}


_MODIFIERS = (
    *(None, "alt", "cmd/ctrl", "shift", "alt+shift", "cmd/ctrl+alt", "cmd/ctrl+shift"),
    "cmd/ctrl+alt+shift",
)
_PLACE = _vector(3, _FARTHEST)
_ON_SCREEN = _vector(2)

_CAMERA: Mapping[str, _Field] = {
    "wxyz": _quaternion,
    "position": _vector(3),
    "fov": number,
    "near": number,
    "far": number,
    "image_height": _pixels,
    "image_width": _pixels,
    "look_at": _vector(3),
    "up_direction": _vector(3),
}
_CONTROLLING: Mapping[str, Mapping[str, _Field]] = {
    "GuiUpdateMessage": {"uuid": _text, "updates": _updates},
    "TransformControlsUpdateMessage": {
        "name": _text,
        "wxyz": _quaternion,
        "position": _PLACE,
        "owner": _text,
    },
    "TransformControlsDragStartMessage": {"name": _text, "owner": _text},
    "TransformControlsDragEndMessage": {"name": _text, "owner": _text},
    "SceneNodeClickMessage": {
        "name": _text,
        "instance_index": _optional(number),
        "ray_origin": _vector(3),
        "ray_direction": _vector(3),
        "screen_pos": _ON_SCREEN,
        "modifier": _one_of(*_MODIFIERS),
        "owner": _text,
    },
    "SceneNodeDragMessage": {
        "phase": _one_of("start", "update", "end"),
        "name": _text,
        "instance_index": _optional(number),
        "start_position": _PLACE,
        "start_screen_pos": _ON_SCREEN,
        "end_position": _PLACE,
        "end_screen_pos": _ON_SCREEN,
        "button": _one_of("left", "middle", "right"),
        "modifier": _one_of(*_MODIFIERS),
        "owner": _text,
    },
}
"""Messages of viser's client that our pages use. Excluded are a tunnel to another website, files,
and changes of a control other than its value."""


def checked(data: bytes | str, *, leads: bool) -> bytes | None:
    """Returns a browser's message in a form that is safe for the session's server.

    Args:
        data: The websocket's message.
        leads: Whether the browser may control the session, and not only watch it.

    Returns:
        The message, encoded again; None if it is ignored.

    Raises:
        BadMessageError: It is not a message that our pages send.
    """
    fields = unpack(data)
    kind = fields.pop("type", None)
    if not isinstance(kind, str):
        raise BadMessageError("no type")
    if kind == "ViewerCameraMessage":
        known = _CAMERA
    elif kind in _CONTROLLING:
        known = _CONTROLLING[kind]
    else:
        raise BadMessageError("an unknown type")
    if fields.keys() - known.keys() or known.keys() - fields.keys() - {"owner"}:
        raise BadMessageError("fields that are not the type's")
    message = {name: known[name](value) for name, value in fields.items()}
    if not leads and kind in _CONTROLLING:
        return None
    packed: bytes = msgpack.packb({"type": kind} | message)
    return packed
