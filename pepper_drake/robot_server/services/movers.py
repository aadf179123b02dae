"""Arbitration of clients that move the robot: the last one wins, and the log reports conflicts."""

from collections.abc import Callable, Iterable

from pepper_drake.robot_server.wire.service import Caller

_RECENT = 1.0
"""Time after its last command for which a client counts as moving a joint [s]."""


class Movers:
    """Remembers which client moved which joint last."""

    def __init__(self, log: Callable[[str], None], now: Callable[[], float]) -> None:
        """Starts without movers.

        Args:
            log: Takes a line, once for each pair of clients.
            now: The robot's clock [s].
        """
        self._log = log
        self._now = now
        self._last: dict[str, tuple[Caller, float]] = {}
        self._logged: set[tuple[int, int]] = set()

    def claim(self, caller: Caller, joints: Iterable[str]) -> None:
        """Records that a client moves joints."""
        now = self._now()
        for joint in joints:
            before, time = self._last.get(joint, (caller, now))
            self._last[joint] = (caller, now)
            pair = (before.client, caller.client)
            if before.client != caller.client and now - time < _RECENT and pair not in self._logged:
                self._logged.add(pair)
                self._log(f"{_name(caller)} moves {joint}, which {_name(before)} was moving")


def _name(caller: Caller) -> str:
    return f"client {caller.client}" + (f" ({caller.address})" if caller.address else "")
