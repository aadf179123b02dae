"""Names and ranges of what a person can do on the live page, apart from the page itself."""

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
"""The buttons and the key of each, as browsers name keys."""

_STEP, _TURN = 0.005, np.radians(2.0)
"""A key moves the hand by this [m], or turns it by this [rad]."""
MOVES = {
    "ArrowRight": (1, 0, 0),
    "ArrowLeft": (-1, 0, 0),
    "ArrowUp": (0, 1, 0),
    "ArrowDown": (0, -1, 0),
    "PageUp": (0, 0, 1),
    "PageDown": (0, 0, -1),
}
"""Keys that move the hand to the right, away, and up, as one sees it."""
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
"""Box in T [m] within which the hand can be led."""
_FARTHEST = 0.2
"""Range in which what is in the scene can be moved along each axis [m]."""
_ADDED_LOWER, _ADDED_UPPER = np.array([0.0, -0.8, 0.03]), np.array([0.9, 0.8, 1.4])
"""Box in W [m] in which what was added to the scene can be."""


def within_reach(X_TG: RigidTransform) -> RigidTransform:
    """Returns a pose of the hand with its position within the box in which it can be led."""
    position = np.clip(X_TG.translation(), HAND_LOWER, HAND_UPPER)
    return RigidTransform(X_TG.rotation(), position)


def stepped(X_TG: RigidTransform, key: str, right_T: Vector, ahead_T: Vector) -> RigidTransform:
    """Returns the pose of the hand a key further on.

    Args:
        X_TG: As it is.
        key: Of `MOVES` or `TURNS`.
        right_T: (3,) the direction that is to the right for who looks on, a unit vector in T.
        ahead_T: (3,) the direction away from who looks on, along the floor, a unit vector in T.
    """
    if key in MOVES:
        right, ahead, up = MOVES[key]
        way = right * right_T + ahead * ahead_T + np.array([0.0, 0.0, up])
        return within_reach(RigidTransform(X_TG.rotation(), X_TG.translation() + _STEP * way))
    turn = RollPitchYaw(_TURN * np.array(TURNS[key])).ToRotationMatrix()
    return RigidTransform(turn @ X_TG.rotation(), X_TG.translation())


def clamped_offset(offset: Vector) -> Vector:
    """Returns an offset (3,) [m] within the range in which what is in the scene can be moved."""
    return np.clip(offset, -_FARTHEST, _FARTHEST)


def clamped_place(position: Vector) -> Vector:
    """Returns a place (3,) in W [m] where what was added to the scene may be."""
    return np.clip(position, _ADDED_LOWER, _ADDED_UPPER)


def plain_name(name: str) -> str:
    """Returns the name of what can be moved, as a person says it."""
    return {"goal_object": "goal"}.get(name, name.removeprefix("spare_").replace("_", " "))
