"""State of a fault: when it is active, and the values held in place of new ones."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np

from pepper_drake.systems.faults.fault import SIGNALS, Fault

Values = tuple[Any, ...]

CORRUPTING = ("garbage", "wrong", "noisy")
"""Kinds that change each value and need no memory of past ones."""


class Role(Enum):
    """Role of a port in a signal."""

    VALUE = "value"
    """The signal itself."""
    CARRIED = "carried"
    """A value that accompanies it, such as the pose of an image."""
    STAMP = "stamp"
    """Time stamp of the value [s]: it changes with each new value."""
    AGE = "age"
    """Time since the value was measured [s]: it grows until a new value arrives."""
    VALID = "valid"
    """1 while there is a value."""


@dataclass(frozen=True)
class SignalNow:
    """A signal at one tick.

    Attributes:
        time: [s].
        stamp: Time stamp of the value [s]; NaN for a signal without one.
        triggered: Whether the trigger of a fault without a start time is set.
        values: Copies the values of all ports.
    """

    time: float
    stamp: float
    triggered: bool
    values: Callable[[], Values]


@dataclass(frozen=True)
class FaultMemory:
    """Immutable state of a fault.

    Attributes:
        begun: When the fault began [s]; NaN before.
        active: Whether the signal fails now.
        count: Number of updates while active: seeds the random numbers.
        held: The values that are output in place of new ones.
        lag: Age of the held values [s].
        held_since: When they were captured [s].
        queue: Past values with their times, oldest first.
        stamp: Time stamp of the last value [s].
    """

    begun: float = np.nan
    active: bool = False
    count: int = 0
    held: Values | None = None
    lag: float = 0.0
    held_since: float = 0.0
    queue: tuple[tuple[float, Values], ...] = ()
    stamp: float = np.nan

    def advanced(self, fault: Fault, signal: SignalNow, seed: tuple[int, ...]) -> "FaultMemory":
        """Returns the memory after a tick.

        Args:
            fault: What fails, and when.
            signal: The signal at this tick.
            seed: With the count, it decides which values of an intermittent signal are lost.
        """
        memory, kind, time = self._begun(fault, signal), fault.kind, signal.time
        is_active = not np.isnan(memory.begun) and time < memory.begun + fault.duration - 1e-9
        delay = SIGNALS[fault.signal].delay
        if kind == "delayed":
            memory = memory._queued(signal, delay)
        if not is_active:
            return replace(memory, active=False) if memory.active else memory
        memory = replace(memory, active=True, count=memory.count + 1)
        if kind in CORRUPTING:
            return memory
        if kind == "delayed":
            old = [entry for entry in memory.queue if entry[0] <= time - delay + 1e-9]
            since, held = old[-1] if old else memory.queue[0]
            return replace(memory, held=held, lag=time - since)
        if memory.held is None or memory._takes_new(fault, signal, seed):
            return replace(
                memory, held=signal.values(), held_since=time, lag=0.0, stamp=signal.stamp
            )
        return replace(memory, lag=time - memory.held_since, stamp=signal.stamp)

    def _begun(self, fault: Fault, signal: SignalNow) -> "FaultMemory":
        if not np.isnan(self.begun):
            return self
        begins = signal.triggered if np.isnan(fault.start) else signal.time >= fault.start - 1e-9
        return replace(self, begun=signal.time) if begins else self

    def _takes_new(self, fault: Fault, signal: SignalNow, seed: tuple[int, ...]) -> bool:
        """Tells whether the present value passes."""
        if fault.kind == "slow":
            return signal.time >= self.held_since + SIGNALS[fault.signal].slow_period - 1e-9
        if fault.kind == "intermittent":
            if signal.stamp == self.stamp:  # Not for NaN: a signal without stamps is always new.
                return False
            return bool(np.random.default_rng((*seed, self.count)).random() < 0.5)
        return False

    def _queued(self, signal: SignalNow, delay: float) -> "FaultMemory":
        """Returns the memory with the present values appended to its queue."""
        if self.queue and signal.stamp == self.stamp:
            return self
        queue = (*self.queue, (signal.time, signal.values()))
        # Keep the newest value that is at least `delay` old.
        while len(queue) > 1 and queue[1][0] <= signal.time - delay:
            queue = queue[1:]
        return replace(self, queue=queue, stamp=signal.stamp)

    def __deepcopy__(self, memo: dict) -> "FaultMemory":
        """Returns itself: Drake copies the state at each event, and this never changes."""
        return self
