"""A plan's poses as `setAngles` commands that are sent ahead of time.

ALMotion brings each target to rest. Therefore a target is the plan's pose a lookahead from now,
with the fraction of the largest speed at which the joint takes exactly that time: it never arrives
while commands keep coming, and stops by itself when they do not.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]

MARGIN = 0.04
"""Lookahead beyond the round trip [s]."""

LONGEST_LOOKAHEAD = 0.25
"""Largest lookahead: an arm moves on for that time after its last command [s]."""

LEAST_FRACTION = 0.02
"""Fraction below which a real joint may stick."""

LARGEST_FRACTION = 0.6
"""Largest fraction that a plan needs."""


@dataclass(frozen=True)
class StreamedCommand:
    """One `setAngles`.

    Attributes:
        names: Joints.
        targets: Position of each a lookahead from now [rad].
        fractions: Fraction of the largest speed of each.
    """

    names: tuple[str, ...]
    targets: tuple[float, ...]
    fractions: tuple[float, ...]

    @property
    def fraction(self) -> float:
        """The common fraction with which no joint is late."""
        return max(self.fractions)


def lookahead(round_trip: float) -> float | None:
    """Returns how far ahead commands must be sent, None if the link is too slow [s].

    Args:
        round_trip: Time from a call to its answer [s].
    """
    ahead = max(round_trip, 0.0) + MARGIN
    return ahead if ahead <= LONGEST_LOOKAHEAD else None


def streamed_command(
    names: Sequence[str],
    now: npt.ArrayLike,
    ahead: npt.ArrayLike,
    seconds: float,
    max_velocity: npt.ArrayLike,
) -> StreamedCommand:
    """Makes the command that moves joints to a pose in a given time.

    Args:
        names: Joints (n).
        now: Current commanded positions (n,) [rad].
        ahead: Commanded positions at the lookahead (n,) [rad].
        seconds: The lookahead [s].
        max_velocity: Their largest speeds (n,) [rad/s].

    Returns:
        The command.

    Raises:
        ValueError: A number is not finite, the lookahead is not above 0, or sizes differ.
    """
    start, goal, fastest = (np.asarray(v, dtype=float) for v in (now, ahead, max_velocity))
    if not start.shape == goal.shape == fastest.shape == (len(names),):
        raise ValueError(f"{len(names)} joints, but poses of {start.shape} and {goal.shape}")
    if not (np.isfinite(start).all() and np.isfinite(goal).all() and seconds > 0.0):
        raise ValueError("a pose that is streamed must be finite, and ahead of now")
    needed = np.abs(goal - start) / seconds / fastest
    fractions = np.clip(needed, LEAST_FRACTION, LARGEST_FRACTION)
    return StreamedCommand(tuple(names), tuple(goal.tolist()), tuple(fractions.tolist()))
