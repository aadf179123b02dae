"""Offset of the robot's clock from ours, and interpolation of measurements in time."""

from bisect import bisect_right
from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]


def split_time(time: float) -> tuple[int, int]:
    """Returns a time as NAOqi's whole seconds and microseconds.

    In one of NAOqi's 32-bit floats it would be wrong by a minute.
    """
    microseconds = round(time * 1e6)
    return microseconds // 1_000_000, microseconds % 1_000_000


def join_time(seconds: int, microseconds: int) -> float:
    """Returns NAOqi's seconds and microseconds as one time [s]."""
    return seconds + microseconds * 1e-6


@dataclass(frozen=True)
class ClockSample:
    """One request for the robot's time.

    Attributes:
        asked: Time of the request by our clock [s].
        answered: Time of the answer by our clock [s].
        robot: The robot's time in the answer [s].
    """

    asked: float
    answered: float
    robot: float


@dataclass(frozen=True)
class ClockOffset:
    """The offset of the robot's clock from ours.

    Attributes:
        offset: The robot's time minus ours [s].
        bound: Error bound, half the round trip of its sample [s].
        at: Time of the sample by our clock [s].
    """

    offset: float
    bound: float
    at: float


def clock_offset(samples: list[ClockSample]) -> ClockOffset:
    """Measures the clock offset from the sample with the shortest round trip.

    Cristian's algorithm (Cristian 1989): the robot read its clock between request and answer.

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
    """Measured vectors of the last seconds, interpolated in time."""

    def __init__(self, span: float = 2.0) -> None:
        """Keeps measurements of the last `span` [s]."""
        self._span = span
        self._times: deque[float] = deque()
        self._values: deque[Vector] = deque()

    def add(self, time: float, value: npt.ArrayLike) -> None:
        """Adds a measurement; one that is not newer than the last is ignored."""
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
        """Returns the newest measurement and its time, or None."""
        return (self._times[-1], self._values[-1].copy()) if self._times else None
