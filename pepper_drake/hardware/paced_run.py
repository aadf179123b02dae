"""Advances a diagram with the wall's clock: one command each 20 ms, and never a burst.

Drake's own real-time rate only slows a simulation down: after a pause it catches up as fast as it
can, and would send all commands of the pause at once. Here the diagram's time stands still for as
long as this computer was late, as when it plans: the arm was held by the link meanwhile, and
goes on from where it is.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from pydrake.systems.analysis import Simulator

from pepper_drake.models.control_model import CONTROL_PERIOD

_PAUSES_KEPT = 100
"""Pauses by which times of the past are still told; what is measured is younger than they are."""


class DiagramClock:
    """The diagram's time beside the wall's: it stands still in pauses."""

    def __init__(
        self,
        wall: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Makes a clock that begins now.

        Args:
            wall: Tells the wall's time [s].
            sleep: Waits for a time [s].
        """
        self.wall, self.sleep = wall, sleep
        self.begin()

    def begin(self) -> None:
        """Lets the diagram's time be 0 now."""
        self._start = self.wall()
        self._pauses: list[tuple[float, float]] = []

    def now(self) -> float:
        """Returns the diagram's time [s]."""
        return self.at(self.wall())

    def at(self, wall: float) -> float:
        """Returns the diagram's time at a time of the wall's clock [s]."""
        passed = wall - self._start
        for begin, duration in self._pauses:
            passed -= min(max(wall - begin, 0.0), duration)
        return passed

    def pause(self, duration: float) -> None:
        """Lets the last part of the time [s] be a pause, in which the diagram's stood still."""
        self._pauses.append((self.wall() - duration, duration))
        if len(self._pauses) > _PAUSES_KEPT:
            self._start += self._pauses.pop(0)[1]


@dataclass(frozen=True)
class Pacing:
    """Timing of a paced run.

    Attributes:
        steps: Steps that were made.
        skipped: Periods in which the diagram's time stood still, as the step before took too long.
        worst: Longest time by which a step was late [s].
    """

    steps: int
    skipped: int
    worst: float


def run_paced(
    simulator: Simulator,
    clock: DiagramClock,
    is_over: Callable[[], bool],
    *,
    period: float = CONTROL_PERIOD,
) -> Pacing:
    """Advances a simulator step by step, in time, until told that it is over.

    Args:
        simulator: Of a diagram whose periodic events read and command at `period`.
        clock: The diagram's; it begins anew.
        is_over: Asked before each step.
        period: Time between steps [s].

    Returns:
        How the time was kept.
    """
    steps, skipped, worst = 0, 0, 0.0
    simulator.Initialize()
    clock.begin()
    while not is_over():
        number = steps + 1
        early = number * period - clock.now()
        if early > 0.0:
            clock.sleep(early)
        else:
            worst = max(worst, -early)
            missed = int(-early / period)
            skipped += missed
            if missed:
                clock.pause(missed * period)
        simulator.AdvanceTo(number * period)
        steps = number
    return Pacing(steps, skipped, worst)
