"""Distances between arm and obstacles at which something happens, in one ordered table."""

import itertools
from dataclasses import dataclass

from pepper_drake.errors import InputError

FARTHEST = 0.15
"""Distance beyond which none is computed [m]: all clearances are less."""


@dataclass
class ClearanceTable:
    """Distances of the arm to the obstacle cloud, from the one that stops it to the one aimed at.

    They must rise in the order stop < start < replan < resume < want < optimise < retreat:
    otherwise a plan that is just good enough to start would be stopped or replanned at once. All
    must be less than `FARTHEST`.

    Raises:
        InputError: A clearance is not greater than the one before it.
    """

    stop: float = 0.002
    """The safety monitor stops the arm below this [m]: the cloud's noise, twice."""
    start: float = 0.006
    """A plan with less is refused [m]: `stop`, and what the tracking error may take away."""
    replan: float = 0.012
    """A movement whose rest sinks below this is planned anew [m]."""
    resume: float = 0.015
    """An arm that waited goes on with less only if no better path is found [m]; the fallback
    planner looks for paths with this."""
    want: float = 0.016
    """A plan with this is taken without looking for a better one [m]."""
    optimise: float = 0.020
    """The trajectory search aims at this [m]: `want`, and what fitting a primitive loses."""
    retreat: float = 0.060
    """An arm that steps aside goes to where it has this [m]: a forearm's radius."""

    def __post_init__(self) -> None:
        """Checks the order."""
        self.check()

    def check(self) -> None:
        """Raises InputError unless the clearances rise; loaders that set fields call it again."""
        names = ("stop", "start", "replan", "resume", "want", "optimise", "retreat")
        for lower, upper in itertools.pairwise(names):
            low, high = getattr(self, lower), getattr(self, upper)
            if not low < high:
                raise InputError(
                    f"clearance.{upper} is {high:g} m; it must be greater than "
                    f"clearance.{lower}, {low:g} m"
                )
        if not self.retreat < FARTHEST:
            raise InputError(
                f"clearance.retreat is {self.retreat:g} m; it must be less than {FARTHEST:g} m, "
                "beyond which no distance is computed"
            )
