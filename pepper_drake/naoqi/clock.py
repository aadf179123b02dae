"""The robot's clock against ours, and what was measured at a time in between."""

from bisect import bisect_right
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]


def split_time(time: float) -> tuple[int, int]:
    """Returns a time as NAOqi passes it, whole seconds and microseconds.

    A time in one of NAOqi's 32-bit floats would be wrong by a minute.
    """
    microseconds = round(time * 1e6)
    return microseconds // 1_000_000, microseconds % 1_000_000


def join_time(seconds: int, microseconds: int) -> float:
    """Returns NAOqi's seconds and microseconds as one time [s]."""
    return seconds + microseconds * 1e-6


@dataclass(frozen=True)
class ClockSample:
    """One question for the robot's time.

    Attributes:
        asked: When it was asked, by our clock [s].
        answered: When the answer came, by our clock [s].
        robot: The robot's time in the answer [s].
    """

    asked: float
    answered: float
    robot: float


@dataclass(frozen=True)
class ClockOffset:
    """The offset of the robot's clock from ours.

    Attributes:
        offset: Robot's time less ours [s].
        bound: Half the round trip of the sample that it is from: it cannot be further off [s].
        at: When it was measured, by our clock [s].
    """

    offset: float
    bound: float
    at: float


def clock_offset(samples: list[ClockSample]) -> ClockOffset:
    """Measures the offset of the robot's clock from the sample with the shortest round trip.

    Cristian's algorithm (Cristian 1989): the robot read its clock between question and answer.

    Raises:
        ValueError: There is no sample, or one was answered before it was asked.
    """
    if not samples:
        raise ValueError("the robot's clock was not asked")
    if any(sample.answered < sample.asked for sample in samples):
        raise ValueError("our own clock went backwards while the robot's was asked")
    best = min(samples, key=lambda sample: sample.answered - sample.asked)
    middle = (best.asked + best.answered) / 2
    return ClockOffset(best.robot - middle, (best.answered - best.asked) / 2, middle)


class MeasurementHistory:
    """Measured vectors of the last seconds, and what they were at any time in between."""

    def __init__(self, span: float = 2.0) -> None:
        """Keeps what is younger than `span` [s]."""
        self._span = span
        self._times: deque[float] = deque()
        self._values: deque[Vector] = deque()

    def add(self, time: float, value: npt.ArrayLike) -> None:
        """Adds a measurement; one that is not newer than the last is passed over."""
        if self._times and time <= self._times[-1]:
            return
        self._times.append(time)
        self._values.append(np.array(value, dtype=float))
        while time - self._times[0] > self._span:
            self._times.popleft()
            self._values.popleft()

    def at(self, time: float) -> Vector | None:
        """Interpolates at a time; None before the oldest, after the newest, or when it is NaN."""
        if not self._times or not self._times[0] <= time <= self._times[-1]:
            return None
        k = bisect_right(self._times, time)
        if k == len(self._times):
            return self._values[-1].copy()
        t0, t1 = self._times[k - 1], self._times[k]
        share = (time - t0) / (t1 - t0)
        return self._values[k - 1] + share * (self._values[k] - self._values[k - 1])

    def newest(self) -> tuple[float, Vector] | None:
        """Returns the newest measurement and its time, if there is one."""
        return (self._times[-1], self._values[-1].copy()) if self._times else None
