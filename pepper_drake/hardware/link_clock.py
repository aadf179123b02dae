"""The clock by which a robot is led."""

import asyncio
import time
from dataclasses import dataclass


@dataclass(frozen=True)
class LinkClock:
    """The machine's monotonic clock, or a slower one beside a served robot whose clock is slow.

    Attributes:
        rate: Its rate beside the machine's; that of `serve_naoqi.py --rate`, and 1 for a robot.
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
