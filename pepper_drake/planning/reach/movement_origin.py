"""Origins of movements."""

from enum import IntEnum


class Origin(IntEnum):
    """Origin of a movement."""

    NONE = 0
    """No movement is performed: the arm rests or waits."""
    TAUGHT = 1
    """The taught movement; the coupling may deflect it."""
    ADAPTED = 2
    """The taught movement, adapted to the obstacles seen before the arm started."""
    DETOUR = 3
    """The rest of a movement, replanned during the motion."""
    RETREAT = 4
    """Back along the travelled path, away from a new obstacle."""
    RETURN = 5
    """Back to the posture of the start, for the robot to drive to another base placement."""
