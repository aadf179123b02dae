"""Faults of a served robot on demand, to try what a program makes of them."""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from pepper_drake.robot_server.wire.service import Service, ServiceError, as_awaitable

_LONGEST_DELAY = 60.0
"""Longest delay of calls [s]."""


class FaultsOnDemand:
    """Disturbs the calls of services' methods."""

    def __init__(self, services: Sequence[Service], restart: Callable[[], None]) -> None:
        """Disturbs nothing yet.

        Args:
            services: Of the robot.
            restart: Ends all connections, as a reboot does; the next ones see another session.
        """
        self._methods = [(s, method) for s in services for method in s.methods.values()]
        self._delay = 0.0
        self._failing: frozenset[str] = frozenset()
        self.restart = restart

    def delay(self, seconds: float) -> None:
        """Performs each call this much later [s]; 0 ends that.

        Raises:
            ValueError: The delay is negative or too long.
        """
        if not 0.0 <= seconds <= _LONGEST_DELAY:
            raise ValueError(f"the delay must be between 0 and {_LONGEST_DELAY:g} s")
        self._delay = seconds
        self._apply()

    def fail(self, methods: Sequence[str]) -> None:
        """Lets these methods fail, such as "ALMotion.setAngles", and no others.

        Raises:
            ValueError: There is no such method.
        """
        known = {f"{service.name}.{method.name}" for service, method in self._methods}
        for name in methods:
            if name not in known:
                raise ValueError(f"there is no method {name!r}")
        self._failing = frozenset(methods)
        self._apply()

    def _apply(self) -> None:
        for service, method in self._methods:
            handler = method.handler
            if f"{service.name}.{method.name}" in self._failing:
                handler = partial(_fail, f"{service.name}::{method.name}")
            elif self._delay > 0.0:
                handler = partial(_perform_later, self._delay, handler)
            service.methods[method.uid] = replace(method, handler=handler)


def _fail(name: str, *_: Any) -> None:
    raise ServiceError(f"{name}: fails on demand")


async def _perform_later(delay: float, handler: Callable[..., Any], *arguments: Any) -> Any:
    await asyncio.sleep(delay)
    result = handler(*arguments)
    waiting = as_awaitable(result)
    return result if waiting is None else await waiting
