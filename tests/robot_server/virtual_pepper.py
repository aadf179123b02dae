"""A served Pepper in virtual time: cycles pass as fast as they can be computed."""

import asyncio
from collections.abc import Callable, Coroutine
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any

from pepper_drake.naoqi.constants import CYCLE, JOINTS
from pepper_drake.robot_server.robot.robot_port import KinematicRobot
from pepper_drake.robot_server.served_pepper import ServedPepper
from pepper_drake.robot_server.wire.service import Caller, Service

CALLER = Caller(client=1)


class AtOnce(ThreadPoolExecutor):
    """Does at once what other threads would do: the robot's clock does not run on meanwhile.

    Attributes:
        done: Names of the functions that were run.
    """

    def __init__(self) -> None:
        super().__init__()
        self.done: set[str] = set()

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> "Future[Any]":
        self.done.add(fn.args[0].__name__)  # `asyncio.to_thread` runs it in a context.
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class VirtualPepper:
    """Calls methods by name as a client would, and lets time pass."""

    def __init__(
        self, *, awake: bool = True, follow: float = 1.0, files: Path | None = None
    ) -> None:
        self.robot = KinematicRobot(follow=follow)
        self.lines: list[str] = []
        self.pepper = ServedPepper(self.robot, log=self.lines.append, awake=awake, files=files)
        self.services: dict[str, Service] = {s.name: s for s in self.pepper.services}
        self.history: list[Any] = []
        self.pepper.step()

    @property
    def motion(self) -> Any:
        return self.pepper.motion

    def call(self, method: str, *arguments: Any, caller: Caller = CALLER) -> Any:
        """Calls `ALService.method`, the overload that takes as many arguments."""
        service, name = method.split(".")
        overloads = list(self.services[service].overloads(name))
        fitting = [m for m in overloads if count(m.parameters) == len(arguments)]
        assert fitting, f"{method} does not take {len(arguments)} arguments"
        found = fitting[0]
        return found.handler(*((caller,) if found.wants_caller else ()), *arguments)

    def start(self, method: str, *arguments: Any, caller: Caller = CALLER) -> asyncio.Task[Any]:
        """Starts a call that takes time."""
        return asyncio.get_running_loop().create_task(self.call(method, *arguments, caller=caller))

    async def run(self, seconds: float) -> None:
        """Lets time pass."""
        for _ in range(round(seconds / CYCLE)):
            await self.cycle()

    async def finish(self, task: "asyncio.Task[Any]", within: float = 60.0) -> float:
        """Lets time pass until a call has returned; returns how long that took [s]."""
        begin = self.robot.now
        while not task.done():
            assert self.robot.now - begin < within, "the call does not return"
            await self.cycle()
        task.result()
        return self.robot.now - begin

    async def cycle(self) -> None:
        await asyncio.sleep(0)
        self.robot.advance(CYCLE)
        self.pepper.step()
        self.history.append(self.robot.commands[-1])
        await asyncio.sleep(0)
        await asyncio.sleep(0)

    def angle(self, joint: str) -> float:
        """Returns the commanded angle."""
        return float(self.motion.joints.command[JOINTS.index(joint)])


def virtual(scenario: Callable[[VirtualPepper], Coroutine[Any, Any, None]], **options: Any) -> None:
    """Runs a scenario on a fresh robot."""

    async def run() -> None:
        asyncio.get_running_loop().set_default_executor(AtOnce())
        await scenario(VirtualPepper(**options))

    asyncio.run(run())


def count(parameters: str) -> int:
    """Returns how many arguments a tuple of signatures has."""
    depth, number, k = 0, 0, 1
    while k < len(parameters) - 1:
        letter = parameters[k]
        if letter == "<":
            k = parameters.index(">", k)
        elif letter in "([{":
            number += depth == 0
            depth += 1
        elif letter in ")]}":
            depth -= 1
        else:
            number += depth == 0
        k += 1
    return number
