"""A served Pepper of kinematics alone, in real time on a thread, with faults on demand."""

import asyncio
import multiprocessing
import threading
import time
from contextlib import asynccontextmanager, contextmanager

import numpy as np

from pepper_drake.models.pepper import POSTURES
from pepper_drake.naoqi.constants import CYCLE, JOINTS
from pepper_drake.robot_server.robot.robot_port import KinematicRobot
from pepper_drake.robot_server.served_pepper import ServedPepper
from pepper_drake.robot_server.wire.server import QiServer


class ServedRobot:
    """The server, its robot, and when time passes for it."""

    def __init__(self, **options):
        self.robot = KinematicRobot(now=time.time())
        self.lines = []
        self.pepper = ServedPepper(self.robot, log=self.lines.append)
        self.server = QiServer(self.pepper.services, port=0, **options)
        self.pepper.finder = self.server
        self.frozen = False
        self.loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    @property
    def address(self):
        return self.server.address

    def start(self):
        self._thread.start()
        assert self._ready.wait(10)

    def stop(self):
        self.do(self._task.cancel)
        asyncio.run_coroutine_threadsafe(self.server.close(), self.loop).result(10)
        self.loop.call_soon_threadsafe(self.loop.stop)
        self._thread.join(10)

    def do(self, action):
        """Does something on the server's loop and waits for it."""

        async def run():
            return action()

        return asyncio.run_coroutine_threadsafe(run(), self.loop).result(10)

    def _run(self):
        asyncio.set_event_loop(self.loop)
        self.loop.run_until_complete(self.server.start())
        self._task = self.loop.create_task(self._cycles())
        self._ready.set()
        self.loop.run_forever()
        self.loop.close()

    async def _cycles(self):
        due = time.monotonic()
        while True:
            if not self.frozen:
                self.robot.advance(CYCLE)
                self.pepper.step()
            due = max(due + CYCLE, time.monotonic() - CYCLE)
            await asyncio.sleep(max(due - time.monotonic(), 0.0))


@contextmanager
def served(**options):
    robot = ServedRobot(**options)
    robot.start()
    try:
        yield robot
    finally:
        robot.stop()


@asynccontextmanager
async def delayed(address, seconds):
    """Yields an address behind which another one answers later by twice a time [s]."""
    host, port = address.removeprefix("tcp://").split(":")
    pumps, writers = set(), []

    async def pump(reader, writer):
        while data := await reader.read(65536):
            asyncio.get_running_loop().call_later(seconds, writer.write, data)

    async def accept(reader, writer):
        there = await asyncio.open_connection(host, int(port))
        writers.extend((writer, there[1]))
        for source, sink in ((reader, there[1]), (there[0], writer)):
            pumps.add(asyncio.ensure_future(pump(source, sink)))

    server = await asyncio.start_server(accept, "127.0.0.1", 0)
    try:
        yield f"tcp://127.0.0.1:{server.sockets[0].getsockname()[1]}"
    finally:
        server.close()
        for task in pumps:
            task.cancel()
        await asyncio.gather(*pumps, return_exceptions=True)
        for writer in writers:
            writer.close()


class ServedApart:
    """A served robot in a process of its own, beside which Drake may take all of the time."""

    def __init__(self, pipe):
        self._pipe, self.address = pipe, pipe.recv()

    def do(self, action, *arguments):
        """Does something with the ServedRobot, on its loop: a function of a module."""
        self._pipe.send((action, arguments))
        return self._pipe.recv()


@contextmanager
def served_apart():
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve_apart, args=(theirs,), daemon=True)
    process.start()
    try:
        yield ServedApart(ours)
    finally:
        ours.send(None)
        process.join(10)


def _serve_apart(pipe):
    with served() as robot:
        robot.do(lambda: stand(robot))
        pipe.send(robot.address)
        while request := pipe.recv():
            action, arguments = request
            pipe.send(robot.do(lambda: action(robot, *arguments)))  # noqa: B023


def stand(robot):
    """Puts all joints to where a standing Pepper has them."""
    posture = np.array([POSTURES["stand"].get(name, 0.0) for name in JOINTS])
    robot.robot.lead(dict(zip(JOINTS, posture.tolist(), strict=True)))
    controller = robot.pepper.motion.joints
    controller.command[:] = controller._target[:] = posture


def right_hand(robot):
    """Returns the right hand's place in the torso's frame [m]."""
    return robot.pepper.motion.get_position("RArm", 0, True)[:3]


def limp(robot, names):
    """Returns whether joints are limp."""
    return max(robot.pepper.motion.get_stiffnesses(names)) == 0.0


def lead(robot, joints):
    """Leads joints by hand to positions by name [rad]."""
    robot.robot.lead(joints)


def press_chest(robot):
    """Presses the chest button."""
    robot.robot.touch("ChestBoard/Button")
