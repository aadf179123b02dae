"""Controls of the live page: their names and ranges, independent of the page itself."""

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RollPitchYaw

Vector = npt.NDArray[np.float64]

BUTTONS = {
    "Record": "KeyR",
    "Stop": "Space",
    "Learn": "KeyL",
    "Reach": "KeyG",
    "Undo": "KeyU",
    "Save": "KeyS",
}
"""The buttons and their keys, as browsers name keys."""

_STEP, _TURN = 0.005, np.radians(2.0)
"""Translation [m] and rotation [rad] of the hand per key press."""
MOVES = {
    "ArrowRight": (1, 0, 0),
    "ArrowLeft": (-1, 0, 0),
    "ArrowUp": (0, 1, 0),
    "ArrowDown": (0, -1, 0),
    "PageUp": (0, 0, 1),
    "PageDown": (0, 0, -1),
}
"""Keys that move the hand to the right, away and up, as seen by the viewer."""
TURNS = {
    "KeyX": (1, 0, 0),
    "KeyZ": (-1, 0, 0),
    "KeyV": (0, 1, 0),
    "KeyC": (0, -1, 0),
    "KeyN": (0, 0, 1),
    "KeyB": (0, 0, -1),
}
"""Keys that turn the hand about Pepper's axes: roll, pitch, yaw."""
KEYS = (*BUTTONS.values(), *MOVES, *TURNS)

HAND_LOWER, HAND_UPPER = np.array([-0.30, -0.65, -0.45]), np.array([0.50, 0.65, 0.45])
"""Box in T within which the hand can be guided [m]."""
_FARTHEST = 0.2
"""Largest displacement of an object of the scene along each axis [m]."""
_ADDED_LOWER, _ADDED_UPPER = np.array([0.0, -0.8, 0.03]), np.array([0.9, 0.8, 1.4])
"""Box in W within which an object added to the scene can be placed [m]."""


def within_reach(X_TG: RigidTransform) -> RigidTransform:
    """Returns a hand pose with its position clamped to the box in which it can be guided."""
    position = np.clip(X_TG.translation(), HAND_LOWER, HAND_UPPER)
    return RigidTransform(X_TG.rotation(), position)


def stepped(X_TG: RigidTransform, key: str, right_T: Vector, ahead_T: Vector) -> RigidTransform:
    """Returns the pose of the hand after a key press.

    Args:
        X_TG: Present pose.
        key: A key of `MOVES` or `TURNS`.
        right_T: (3,) direction to the right of the viewer, a unit vector in T.
        ahead_T: (3,) direction away from the viewer, along the floor, a unit vector in T.
    """
    if key in MOVES:
        right, ahead, up = MOVES[key]
        move = right * right_T + ahead * ahead_T + np.array([0.0, 0.0, up])
        return within_reach(RigidTransform(X_TG.rotation(), X_TG.translation() + _STEP * move))
    turn = RollPitchYaw(_TURN * np.array(TURNS[key])).ToRotationMatrix()
    return RigidTransform(turn @ X_TG.rotation(), X_TG.translation())


def clamped_offset(offset: Vector) -> Vector:
    """Clamps an object's offset (3,) [m] to the range in which it can be moved."""
    return np.clip(offset, -_FARTHEST, _FARTHEST)


def clamped_place(position: Vector) -> Vector:
    """Clamps the position (3,) of an added object in W [m]."""
    return np.clip(position, _ADDED_LOWER, _ADDED_UPPER)


def plain_name(name: str) -> str:
    """Returns the everyday name of a movable object."""
    return {"goal_object": "goal"}.get(name, name.removeprefix("spare_").replace("_", " "))
