"""Advances a diagram in real time: one command every 20 ms, and never a burst.

Drake's own real-time rate only slows a simulation down: after a pause it catches up as fast as it
can, and would send all commands of the pause at once. Here the diagram's time stops while this
computer is late, as during planning: the link holds the arm meanwhile, which then continues from
there.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from pydrake.systems.analysis import Simulator

from pepper_drake.models.control_model import CONTROL_PERIOD

_PAUSES_KEPT = 100
"""Number of recorded pauses, for times in the past; measurements are younger than these."""


class DiagramClock:
    """The diagram's time as a function of wall time: it stops in pauses."""

    def __init__(
        self,
        wall: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Makes a clock that starts now.

        Args:
            wall: Returns the wall time [s].
            sleep: Waits for a time [s].
        """
        self.wall, self.sleep = wall, sleep
        self.begin()

    def begin(self) -> None:
        """Sets the diagram's time to 0."""
        self._start = self.wall()
        self._pauses: list[tuple[float, float]] = []

    def now(self) -> float:
        """Returns the diagram's time [s]."""
        return self.at(self.wall())

    def at(self, wall: float) -> float:
        """Returns the diagram's time [s] at a wall time [s]."""
        passed = wall - self._start
        for begin, duration in self._pauses:
            passed -= min(max(wall - begin, 0.0), duration)
        return passed

    def pause(self, duration: float) -> None:
        """Records a pause of the diagram's time, of a duration [s] until now."""
        self._pauses.append((self.wall() - duration, duration))
        if len(self._pauses) > _PAUSES_KEPT:
            self._start += self._pauses.pop(0)[1]


@dataclass(frozen=True)
class Pacing:
    """Timing of a paced run.

    Attributes:
        steps: Number of steps.
        skipped: Periods in which the diagram's time stopped, because the step before took too long.
        worst: Largest lateness of a step [s].
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
    """Advances a simulator step by step in real time, until it is over.

    Args:
        simulator: Of a diagram whose periodic events read and command at `period`.
        clock: Of the diagram; it is restarted.
        is_over: Asked before each step.
        period: Time between steps [s].

    Returns:
        Timing statistics.
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
