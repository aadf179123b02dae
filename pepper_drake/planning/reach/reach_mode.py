"""The stages of a reach."""

from enum import IntEnum


class ReachMode(IntEnum):
    """What the robot is doing."""

    LOOKING = 0
    DRIVING = 1
    SETTLING = 2
    REACHING = 3
    HOLDING = 4
    DONE = 5
    FAILED = 6
