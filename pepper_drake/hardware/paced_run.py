"""Advances a diagram with the wall's clock: one command each 20 ms, and never a burst.

Drake's own real-time rate only slows a simulation down: after a pause it catches up as fast as it
can, and would send all commands of the pause at once.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

from pydrake.systems.analysis import Simulator

from pepper_drake.models.control_model import CONTROL_PERIOD

LATE_PERIODS = 5
"""Periods without a step after which this computer is too slow."""


@dataclass(frozen=True)
class Pacing:
    """Timing of a paced run.

    Attributes:
        steps: Steps that were made.
        skipped: Steps that were left out because the one before took too long.
        worst: Longest time by which a step was late [s].
    """

    steps: int
    skipped: int
    worst: float


def run_paced(
    simulator: Simulator,
    start: float,
    is_over: Callable[[], bool],
    *,
    period: float = CONTROL_PERIOD,
    wall: Callable[[], float] = time.monotonic,
    sleep: Callable[[float], None] = time.sleep,
) -> Pacing:
    """Advances a simulator to the wall's time, step by step, until told that it is over.

    The diagram's time stays the wall's time less `start`. A step that is late by more than a
    period is followed by the next one on the beat: those between are left out.

    Args:
        simulator: Of a diagram whose periodic events read and command at `period`.
        start: The wall's time at the diagram's time 0 [s].
        is_over: Asked before each step.
        period: Time between steps [s].
        wall: Tells the wall's time [s].
        sleep: Waits for a time [s].

    Returns:
        How the time was kept.
    """
    steps, skipped, worst = 0, 0, 0.0
    number = int((wall() - start) / period) + 1
    while not is_over():
        early = start + number * period - wall()
        if early > 0.0:
            sleep(early)
        else:
            worst = max(worst, -early)
            missed = int(-early / period)
            skipped += missed
            number += missed
        simulator.AdvanceTo(number * period)
        steps += 1
        number += 1
    return Pacing(steps, skipped, worst)
