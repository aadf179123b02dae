"""Modes of a reach, and the user's commands."""

from enum import IntEnum

import numpy as np
import numpy.typing as npt


class ReachMode(IntEnum):
    """Modes of a reach."""

    LOOKING = 0
    DRIVING = 1
    SETTLING = 2
    REACHING = 3
    HOLDING = 4
    DONE = 5
    FAILED = 6
    IDLE = 7


class ReachCommand(IntEnum):
    """Commands of the user or of a task sequence to the supervisor."""

    IDLE = 0
    """Do nothing: the arm is guided by hand, or moved otherwise."""
    REACH = 1
    """Perform one reach, beginning with the search for the goal."""
    STOP = 2
    """End the present reach; the arm brakes and holds still."""
    MOVE = 3
    """Perform one arm movement, planned from the present base pose."""


def last_attempt(mode: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Returns the rows (N,) of a log in which the arm reaches, or holds its hand at the goal.

    Those from other base poses than the last are left out.

    Args:
        mode: The `ReachMode` of each row (N,).
    """
    moving = np.isin(mode, (ReachMode.REACHING, ReachMode.HOLDING))
    last = len(mode) - int(np.argmax(moving[::-1]))
    drives = np.flatnonzero(mode[:last] == ReachMode.DRIVING)
    if len(drives):
        moving[: drives[-1]] = False
    return moving
