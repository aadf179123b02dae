"""Clearance thresholds between arm and obstacles, in one ordered table."""

import itertools
from dataclasses import dataclass, fields

from pepper_drake.errors import InputError

FARTHEST = 0.15
"""Distance above which clearances are not computed [m]: all thresholds are below it."""


@dataclass
class ClearanceTable:
    """Thresholds of the arm's clearance to the obstacle cloud, in ascending order of the fields.

    The order is stop < start < slow < replan < resume < want < search_target < retreat_end:
    otherwise a plan that is just good enough to start would be stopped or replanned at once. All
    must be less than `FARTHEST`.

    Raises:
        InputError: A clearance is not greater than the one before it.
    """

    stop: float = 0.002
    """Clearance below which the safety monitor stops the arm [m]: twice the cloud's noise."""
    start: float = 0.005
    """Least clearance of an accepted plan [m]: `stop` and an allowance for tracking errors."""
    slow: float = 0.009
    """Clearance below which the arm is as slow as in unseen space [m]: more than `stop` and the
    tracking error at 0.5 m/s, 4 mm. The fallback planner searches for paths with this clearance;
    their optimisation widens it."""
    replan: float = 0.012
    """Clearance of the rest of a movement below which it is replanned [m]."""
    resume: float = 0.015
    """Clearance below which a waiting arm resumes only if no better path is found [m]."""
    want: float = 0.016
    """Clearance with which a plan is taken without searching for a better one [m]."""
    search_target: float = 0.020
    """Target of the trajectory search [m]: `want` and the loss from fitting a primitive."""
    retreat_end: float = 0.060
    """Clearance at which a retreat ends [m]: a forearm's radius."""

    def __post_init__(self) -> None:
        """Checks the order."""
        self.check()

    def check(self) -> None:
        """Raises InputError unless the clearances ascend; loaders that set fields call it again."""
        for lower, upper in itertools.pairwise(one.name for one in fields(self)):
            low, high = getattr(self, lower), getattr(self, upper)
            if not low < high:
                raise InputError(
                    f"clearance.{upper} is {high:g} m; it must be greater than "
                    f"clearance.{lower}, {low:g} m"
                )
        if not self.retreat_end < FARTHEST:
            raise InputError(
                f"clearance.retreat_end is {self.retreat_end:g} m; it must be less than "
                f"{FARTHEST:g} m, beyond which no distance is computed"
            )
