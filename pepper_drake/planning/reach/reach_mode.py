"""Modes of a reach, and the user's commands."""

from enum import IntEnum


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
