"""Waiting by the robot's clock, and the common methods of NAOqi's modules."""

import asyncio
import heapq
import itertools
from typing import Any

from pepper_drake.robot_server.robot.tasks import Task, TaskManager
from pepper_drake.robot_server.wire.service import Caller, Service, ServiceError, as_awaitable
from pepper_drake.robot_server.wire.signatures import with_caller

VERSION = "2.5.10.7"
"""The served version of NAOqi."""


class RobotTimer:
    """Sleep by the robot's clock, however slow that runs.

    Attributes:
        now: The robot's clock [s].
    """

    def __init__(self, now: float) -> None:
        self.now = now
        self._order = itertools.count()
        self._waiting: list[tuple[float, int, asyncio.Future[None]]] = []

    async def sleep(self, duration: float) -> None:
        """Returns when a duration has passed by the robot's clock [s]."""
        if duration <= 0.0:
            return
        future: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        heapq.heappush(self._waiting, (self.now + duration, next(self._order), future))
        await future

    def step(self, now: float) -> None:
        """Wakes the sleepers that are due."""
        self.now = now
        while self._waiting and self._waiting[0][0] <= now + 1e-9:
            _, _, future = heapq.heappop(self._waiting)
            if not future.done():
                future.set_result(None)


async def until_ended(tasks: TaskManager, task: Task) -> None:
    """Waits until a task has ended; cancellation of the call kills it."""
    future: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    task.when_ended(lambda: None if future.done() else future.set_result(None))
    try:
        await future
    except asyncio.CancelledError:
        tasks.kill(task.id)
        raise


class Module:
    """Common methods of NAOqi's modules, and asynchronous calls.

    Attributes:
        name: The service's name.
        served: The service made from this module, once it is made.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        self.served: Service | None = None
        self._calls: dict[int, asyncio.Future[Any]] = {}
        self._last_call = 0

    def exit(self) -> None:
        """Refuses: a module cannot be ended remotely."""
        raise ValueError("not allowed: the module ends with the robot")

    def version(self) -> str:
        """Returns NAOqi's version."""
        return VERSION

    def ping(self) -> bool:
        """Returns True."""
        return True

    def get_broker_name(self) -> str:
        """Returns the name of the process."""
        return "naoqi"

    def get_module_help(self) -> list[Any]:
        """Returns the module's description."""
        return [f"{self.name} of a simulated Pepper", []]

    def get_method_list(self) -> list[str]:
        """Returns the names of the methods."""
        return sorted({method.name for method in self._service().methods.values()})

    def get_method_help(self, method: str) -> list[Any]:
        """Returns the signatures of a method."""
        found = [
            [m.name, m.parameters, m.returns]
            for m in self._service().methods.values()
            if m.name == method
        ]
        if not found:
            raise ValueError(f"there is no method {method!r}")
        return found

    def get_usage(self, method: str) -> str:
        """Returns the signatures of a method as text."""
        return "\n".join(f"{n}{p} -> {r}" for n, p, r in self.get_method_help(method))

    @with_caller
    def p_call(self, caller: Caller, uid: int, arguments: list[Any]) -> int:
        """Starts a method asynchronously; returns a number for `wait`, `isRunning`, `stop`."""
        method = self._service().methods.get(uid)
        if method is None:
            raise ValueError(f"there is no method {uid}")
        self._last_call += 1
        who = (caller,) if method.wants_caller else ()
        try:
            value = as_awaitable(method.handler(*who, *arguments))
        except TypeError:
            raise ValueError(f"{len(arguments)} arguments do not fit {method.name}") from None
        if value is not None:
            future = asyncio.ensure_future(value)
            self._calls[self._last_call] = future
            future.add_done_callback(_look)
        return self._last_call

    async def wait(self, call: int, timeout: int = 0) -> bool:
        """Waits for a call with a timeout [ms; 0: none]; returns whether it is still running."""
        future = self._calls.get(call)
        if future is None:
            return False
        await asyncio.wait([future], timeout=timeout / 1000 if timeout > 0 else None)
        return not future.done()

    def is_running(self, call: int) -> bool:
        """Returns whether a call is still running."""
        return call in self._calls and not self._calls[call].done()

    def stop(self, call: int) -> None:
        """Cancels a call."""
        if call in self._calls:
            self._calls[call].cancel()

    def _emit(self, signal: str, *arguments: Any) -> None:
        self._service().emit(signal, *arguments)

    def _service(self) -> Service:
        if self.served is None:
            raise ServiceError(f"{self.name}: not served yet")
        return self.served


def _look(future: "asyncio.Future[Any]") -> None:
    """Retrieves a call's exception, so that asyncio does not warn if nobody waited for it."""
    if not future.cancelled():
        future.exception()
