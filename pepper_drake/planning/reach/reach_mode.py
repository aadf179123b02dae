"""The stages of a reach."""

from enum import IntEnum


class ReachMode(IntEnum):
    """Modes of the reach."""

    LOOKING = 0
    DRIVING = 1
    SETTLING = 2
    REACHING = 3
    HOLDING = 4
    DONE = 5
    FAILED = 6
    IDLE = 7


class ReachCommand(IntEnum):
    """Commands of a person to the robot."""

    IDLE = 0
    """Nothing: the arm is led, or moved in another way."""
    REACH = 1
    """One reach, from the search for the goal on."""
    STOP = 2
    """The end of the present reach; the arm brakes and holds still."""
    MOVE = 3
    """One movement of the arm, planned from where the base stands."""
