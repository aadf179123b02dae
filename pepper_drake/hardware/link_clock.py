"""The clock of a robot's link."""

import asyncio
import time
from dataclasses import dataclass


@dataclass(frozen=True)
class LinkClock:
    """The machine's monotonic clock, or a slower one for a served robot with a slow clock.

    Attributes:
        rate: Relative to the machine's clock: 1, or the served robot's `serve_naoqi.py --rate`.
    """

    rate: float = 1.0

    def now(self) -> float:
        """Returns the time [s], the same in all processes of the machine."""
        return self.rate * time.monotonic()

    def sleep(self, duration: float) -> None:
        """Waits for a duration of this clock [s]."""
        time.sleep(duration / self.rate)

    async def pause(self, duration: float) -> None:
        """Waits for a duration of this clock [s] while other tasks run."""
        await asyncio.sleep(duration / self.rate)
