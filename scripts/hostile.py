"""Sends hostile messages to the page of an app, from many connections at once.

  hostile.py teach                     100,000 messages to the teaching page
  hostile.py reach --count 20000       to the page of reach.py --live
  hostile.py play                      to the window that play.py leaves open
  hostile.py record                    to the page of a recording of ten minutes

Random bytes, messages of the pages with numbers and names that make no sense, damaged ones, long
ones, and requests that are no HTTP or never end. Websites and tokens of others must be refused. The
app must go on serving the page meanwhile, keep its memory (or let it grow as it does without a
message, while it records), and end in order; whatever it recorded of the arm must be within the
joints' limits. Exit code 1 if not.
"""

import argparse
import asyncio
import itertools
import random
import re
import resource
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
from app_process import family, running, start_app
from tornado.httpclient import AsyncHTTPClient, HTTPRequest
from tornado.websocket import WebSocketClosedError, websocket_connect

from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.demonstrations.arm_chain import joint_limits
from pepper_drake.models.guide import ViaPoint, load_guide
from pepper_drake.models.motion import LONGEST
from pepper_drake.models.typed_yaml import save_yaml
from pepper_drake.playback.loading import load_motion

_DEMONSTRATION = "pepper_drake/models/demonstrations/reach"
_LONG = "long.yaml"

RUNS = {
    "teach": ("--no-cameras",),
    "reach": ("--live",),
    "play": (_DEMONSTRATION, "--zmq-url"),
    "record": ("--live", "--guide", _LONG),
    "perceive": ("--live",),
    "reproduce": ("--live", "--primitive", _LONG),
}
"""Options of the apps. A long movement is made for those that end when their movement is over."""
_CALM = {"record": 30.0, "reproduce": 30.0}
"""Apps that record as long as they show anything, and for how long they are first watched without
an attack [s]: by what their memory grows then, it may grow afterwards."""
_DONE = {"reach": "Press Ctrl-C"}
"""Words that an app prints when its work is done. Until then it records, and its memory grows by
that; it is attacked all the same, but the messages and the memory are counted from then on."""
_CONNECTIONS = 24
_STARTING = 180.0
"""Longest time that an app may take to show its page [s]."""
_MORE = 0.05
"""Share by which the memory may grow after the first half of the messages."""
_BEYOND_LIMITS = 1e-3
"""Distance by which a recorded joint may pass its limit: the error of the control [rad]."""


def make_message(dice: random.Random, names: list[str]) -> bytes:
    """Returns a message that no page of ours sends, or one that leads too far."""
    number = dice.choice((struct.unpack("d", dice.randbytes(8))[0], 1e300, -1e9, 1e3, 0.1))
    chance = dice.random()
    if chance < 0.1:
        return dice.randbytes(dice.choice((0, 1, 20, 60, 3000)))
    name = dice.choice([*names, "", "/hand", "x" * 300, "Record (R)", "../../etc/passwd"])
    vector = [number, dice.choice((number, 0.1)), -0.2]
    messages: list[dict[str, Any]] = [
        {"type": "GuiUpdateMessage", "uuid": name, "updates": {"value": number}},
        {"type": "GuiUpdateMessage", "uuid": name, "updates": {"value": True}},
        {"type": "GuiUpdateMessage", "uuid": name, "updates": {"disabled": False}},
        {
            "type": "TransformControlsUpdateMessage",
            "name": name,
            "wxyz": [number, 0.0, 0.0, 1.0],
            "position": vector,
            "owner": "",
        },
        {"type": "FileTransferStart", "uuid": name, "size_bytes": 2**40},
        {"type": "slider", "name": name, "value": number},
        {"type": "button", "name": name, "value": number},
        {
            "type": "gamepad",
            "name": "",
            "value": 0,
            "gamepad": {"index": 0, "axes": [number] * 4, "button_values": [number] * 17},
        },
        {"type": "camera_pose", "camera_pose": [number] * 16, "is_perspective": True},
    ]
    data = bytearray(msgpack.packb(dice.choice(messages)))
    if chance < 0.25:
        for _ in range(dice.randrange(1, 4)):
            data[dice.randrange(len(data))] = dice.randrange(256)
    return bytes(data)


class Attack:
    """Messages sent, and their reception."""

    def __init__(
        self,
        url: str,
        count: int,
        seed: int,
        process: int,
        is_done: Callable[[], bool],
        calm: float,
    ) -> None:
        self._url, self._count, self._process = url, count, process
        self._is_done, self._counts = is_done, False
        self._calm = calm
        self.memory: list[float] = []
        self._times: list[float] = []
        self.growth = 0.0
        self._dice, self._names = random.Random(seed), ["Stop (Space)"]
        self.before = self.sent = self.closed = 0

    async def connect(self, **headers: str) -> Any:
        """Opens the page's websocket, as a browser does."""
        import viser

        # Beside the files of meshcat's own server, which are in a folder.
        url = self._url.replace("http:", "ws:").replace("/static/", "/")
        request = HTTPRequest(url, headers=headers)
        return await websocket_connect(request, subprotocols=[f"viser-v{viser.__version__}"])

    def _goes_on(self) -> bool:
        return self._wants_more() and running(self._process)

    def _wants_more(self) -> bool:
        return not self._counts or self.sent < self._count

    async def watch(self) -> None:
        """Notes the memory at each tenth of the messages that count."""
        while not self._counts and running(self._process):
            await asyncio.sleep(0.2)
            self._counts = self._is_done()
        while self._goes_on():
            if self.sent >= (len(self.memory) + 1) * self._count // 10:
                self._note()
                print(f"{self.sent} messages, {self.memory[-1]:.0f} MiB", flush=True)
            await asyncio.sleep(0.2)
        self._note()

    def _note(self) -> None:
        self.memory.append(memory(self._process))
        self._times.append(time.monotonic())

    async def look_on(self) -> None:
        """Looks on without a message, and notes how the memory grows [MiB/s] in the second half."""
        page = await self.connect()
        reading = asyncio.ensure_future(self._listen(page))
        await asyncio.sleep(0.5 * self._calm)
        before, began = memory(self._process), time.monotonic()
        await asyncio.sleep(0.5 * self._calm)
        self.growth = max(0.0, memory(self._process) - before) / (time.monotonic() - began)
        page.close()
        await reading

    def _grew(self) -> bool:
        """Tells whether the memory grew in the second half of the messages, but for a recording."""
        middle = len(self.memory) // 2 - 1
        recorded = self.growth * (self._times[-1] - self._times[middle])
        return self.memory[-1] > (1.0 + _MORE) * self.memory[middle] + recorded

    async def send(self) -> None:
        """Sends messages until all are sent, over one connection after the other."""
        while self._goes_on():
            try:
                socket = await self.connect()
            except Exception:  # Whatever tells that there is no room at the moment.
                await asyncio.sleep(0.1)
                continue
            gone = asyncio.ensure_future(self._listen(socket))
            while self._wants_more() and not gone.done():
                try:
                    await socket.write_message(make_message(self._dice, self._names), binary=True)
                except WebSocketClosedError:
                    break
                self.sent += self._counts
                self.before += not self._counts
                await asyncio.sleep(0.001)
            self.closed += gone.done()
            socket.close()
            await gone

    async def _listen(self, socket: Any) -> None:
        """Reads what the page is told, to learn the names of its controls."""
        while (data := await socket.read_message()) is not None:
            if len(self._names) < 200 and isinstance(data, bytes):
                self._names += re.findall(
                    r"[0-9a-f]{8}-[0-9a-f-]{27}", data.decode(errors="ignore")
                )

    async def dawdle(self) -> None:
        """Opens connections that say nothing sensible, or never come to an end."""
        host, port = re.findall(r"//([^:/]+):(\d+)", self._url)[0]
        while self._goes_on():
            try:
                _, writer = await asyncio.open_connection(host, int(port))
                start = self._dice.choice(
                    (b"GET / HTTP/1.1\r\nX: ", b"POST / HTTP/1.1\r\n", b"\x16")
                )
                writer.write(start + self._dice.randbytes(self._dice.choice((1, 100, 40_000))))
                await asyncio.sleep(self._dice.uniform(0.0, 3.0))
                writer.close()
            except OSError:
                await asyncio.sleep(0.1)

    async def run(self) -> list[str]:
        """Attacks; returns what was wrong."""
        wrong = []
        fetch = AsyncHTTPClient().fetch
        for headers in ({"Origin": "http://evil.example"}, {"Host": "evil.example"}):
            answer = await fetch(self._url, headers=headers, raise_error=False)
            if answer.code != 403:
                wrong.append(f"{headers} is answered with {answer.code}")
        if self._calm:
            await self.look_on()
        workers = [self.send() for _ in range(_CONNECTIONS)]
        await asyncio.gather(*workers, *(self.dawdle() for _ in range(8)), self.watch())
        if not running(self._process):
            return [*wrong, "the app ended"]
        if self._grew():
            wrong.append("the memory grew")
        answer = await fetch(self._url, raise_error=False, request_timeout=60.0)
        if answer.code != 200:
            wrong.append(f"the page is answered with {answer.code} afterwards")
        return wrong


def memory(process: int) -> float:
    """Memory of a process and of all that it started [MiB]."""
    pages = 0
    for one in family(process):
        try:
            pages += int(Path(f"/proc/{one}/statm").read_text().split()[1])
        except OSError:
            continue
    return pages * resource.getpagesize() / 2**20


def server_of(url: str) -> int:
    """The process of the meshcat server that takes commands at an address."""
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = entry.read_bytes().split(b"\0")
        except OSError:
            continue
        if b"pepper_drake.playback.server" in words and url.encode() in words:
            return int(entry.parent.name)
    raise SystemExit(f"no meshcat server at {url}")


def joints_beyond(folder: Path) -> Iterator[str]:
    """Yields which joints in demonstrations and runs below a folder are beyond their limits."""
    limits = joint_limits()
    for file in (*folder.rglob("joints.csv"), *folder.rglob("log.npz")):
        for name, column in load_motion(file.parent).positions.items():
            lower, upper = limits.get(name, (-np.inf, np.inf))
            if column.min() < lower - _BEYOND_LIMITS or column.max() > upper + _BEYOND_LIMITS:
                yield f"{file}: {name} goes from {column.min():.3f} to {column.max():.3f} rad"


def write_long(app: str, path: Path) -> None:
    """Writes a movement that takes as long as may be, for an app that ends with its movement."""
    if app == "reproduce":
        primitive = MovementPrimitive.fit(Demonstration.load(_DEMONSTRATION), num_basis=20)
        primitive.save(path)
        text = path.read_text()
        slow = re.sub("^duration: .*$", f"duration: {LONGEST:g}", text, flags=re.MULTILINE)
        path.write_text(slow)
    else:  # There and back, again and again.
        guide = load_guide("reach")
        there = guide.via_points
        ways = itertools.cycle((there, there[::-1]))
        poses = itertools.chain.from_iterable(ways)
        times = np.arange(1.0, LONGEST)
        guide.via_points = [
            ViaPoint(float(time), pose.position, pose.rpy)
            for time, pose in zip(times, poses, strict=False)
        ]
        save_yaml(guide, path)


def start(
    app: str, folder: Path, options: tuple[str, ...]
) -> tuple[subprocess.Popen[str], str, Path, Path]:
    """Starts an app.

    Returns:
        The app, its page's address, and the files of its output and its errors.
    """
    output, errors = folder / "output", folder / "errors"
    # Into files: nobody reads while it is attacked, and a full pipe would stop the app.
    with output.open("w") as output_file, errors.open("w") as error_file:
        process = start_app(
            app, folder / "results", *options, stdout=output_file, stderr=error_file
        )
    end = time.monotonic() + _STARTING
    while time.monotonic() < end and process.poll() is None:
        if found := re.search(r"http://\S+(?=\s)", output.read_text()):
            return process, found.group(0), output, errors
        time.sleep(0.1)
    if process.poll() is None:
        process.kill()
        process.wait()
        raise SystemExit(f"{app} showed no page within {_STARTING:g} s")
    raise SystemExit(f"{app} ended with {process.returncode} before it showed a page")


def main() -> int:
    """Runs the program."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("app", choices=tuple(RUNS))
    parser.add_argument("--count", type=int, default=100_000, help="messages")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        arguments = RUNS[options.app]
        if _LONG in arguments:
            write_long(options.app, Path(folder) / _LONG)
            arguments = tuple(folder + "/" + word if word == _LONG else word for word in arguments)
        if options.app == "play":
            with socket.create_server(("127.0.0.1", 0)) as free:
                arguments += (f"tcp://127.0.0.1:{free.getsockname()[1]}",)
        process, url, output, error_file = start(options.app, Path(folder), arguments)
        attacked = process.pid
        if options.app == "play":  # Its window stays when it has ended.
            process.wait(_STARTING)
            attacked = server_of(arguments[-1])
        began = time.monotonic()
        done = _DONE.get(options.app, "")
        attack = Attack(
            url,
            options.count,
            options.seed,
            attacked,
            lambda: done in output.read_text(),
            _CALM.get(options.app, 0.0),
        )
        try:
            wrong = asyncio.run(attack.run())
        finally:
            if options.app == "play":
                start_app("play", folder, "--stop", *arguments[1:]).wait(60.0)
            process.send_signal(signal.SIGTERM)
            process.wait(120.0)
            errors = error_file.read_text()
        wrong += joints_beyond(Path(folder))
    if process.returncode not in (0, 1, 130) or "Traceback" in errors:
        wrong.append(f"the app ended with {process.returncode}: {errors[-500:]}")
    print(
        f"{options.app}: {attack.before} and {attack.sent} messages in "
        f"{time.monotonic() - began:.0f} s, "
        f"{attack.closed} connections closed, exit code {process.returncode}, "
        f"{' '.join(f'{size:.0f}' for size in attack.memory)} MiB"
        f"{f', {attack.growth:.2f} MiB/s without a message' if attack.growth else ''}; "
        f"{'; '.join(wrong) or 'the page was served throughout'}"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
