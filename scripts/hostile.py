"""Sends hostile messages to the page of an app, over many connections at once.

  hostile.py teach                     100,000 messages to the teaching page
  hostile.py reach --count 20000       to the page of reach.py --live
  hostile.py play                      to the window that play.py leaves open
  hostile.py record                    to the page of a recording of ten minutes

Messages are random bytes, messages of the pages with invalid numbers and names, damaged ones and
long ones; requests are not HTTP or never end. Foreign origins and hosts must be refused. The app
must keep serving the page and keep its memory (while it records, let it grow only as without an
attack), and exit cleanly; joints in its recordings must be within their limits. Exit code 1
otherwise.
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
"""Options of the apps. Those that end with their movement get a long one."""
_SETTLING = {"record": 30.0, "reproduce": 30.0}
"""Apps that record while they show anything, and the time for which they are first watched without
an attack [s]: their memory may then grow at the same rate."""
_DONE = {"reach": "Press Ctrl-C"}
"""Text that an app prints when its work is done. Until then its recording lets the memory grow: the
attack runs, but messages and memory only count afterwards."""
_CONNECTIONS = 24
_STARTING = 180.0
"""Timeout until an app shows its page [s]."""
_MEMORY_GROWTH = 0.05
"""Allowed relative growth of the memory in the second half of the messages."""
_OVERSHOOT = 1e-3
"""Allowed overshoot of a recorded joint over its limit: the control error [rad]."""


def make_message(rng: random.Random, names: list[str]) -> bytes:
    """Returns a message that none of our pages sends, or one with extreme values."""
    number = rng.choice((struct.unpack("d", rng.randbytes(8))[0], 1e300, -1e9, 1e3, 0.1))
    chance = rng.random()
    if chance < 0.1:
        return rng.randbytes(rng.choice((0, 1, 20, 60, 3000)))
    name = rng.choice([*names, "", "/hand", "x" * 300, "Record (R)", "../../etc/passwd"])
    vector = [number, rng.choice((number, 0.1)), -0.2]
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
    data = bytearray(msgpack.packb(rng.choice(messages)))
    if chance < 0.25:
        for _ in range(rng.randrange(1, 4)):
            data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data)


class Attack:
    """An attack on a page, with the memory and the number of messages in its course."""

    def __init__(
        self,
        url: str,
        count: int,
        seed: int,
        process: int,
        is_done: Callable[[], bool],
        settling: float,
    ) -> None:
        self._url, self._count, self._process = url, count, process
        self._is_done, self._is_counting = is_done, False
        self._settling = settling
        self.memory: list[float] = []
        self._times: list[float] = []
        self.growth = 0.0
        self._rng, self._names = random.Random(seed), ["Stop (Space)"]
        self.before = self.sent = self.closed = 0

    async def connect(self, **headers: str) -> Any:
        """Opens the page's websocket, as a browser does."""
        import viser

        # Meshcat's own server has its files in a folder beside the websocket.
        url = self._url.replace("http:", "ws:").replace("/static/", "/")
        request = HTTPRequest(url, headers=headers)
        return await websocket_connect(request, subprotocols=[f"viser-v{viser.__version__}"])

    def _is_active(self) -> bool:
        return self._has_messages() and running(self._process)

    def _has_messages(self) -> bool:
        return not self._is_counting or self.sent < self._count

    async def watch(self) -> None:
        """Records the memory at each tenth of the counted messages."""
        while not self._is_counting and running(self._process):
            await asyncio.sleep(0.2)
            self._is_counting = self._is_done()
        while self._is_active():
            if self.sent >= (len(self.memory) + 1) * self._count // 10:
                self._record_memory()
                print(f"{self.sent} messages, {self.memory[-1]:.0f} MiB", flush=True)
            await asyncio.sleep(0.2)
        self._record_memory()

    def _record_memory(self) -> None:
        self.memory.append(memory(self._process))
        self._times.append(time.monotonic())

    async def look_on(self) -> None:
        """Measures the memory's growth without messages [MiB/s], after a settling time."""
        page = await self.connect()
        reading = asyncio.ensure_future(self._listen(page))
        await asyncio.sleep(0.5 * self._settling)
        before, began = memory(self._process), time.monotonic()
        await asyncio.sleep(0.5 * self._settling)
        self.growth = max(0.0, memory(self._process) - before) / (time.monotonic() - began)
        page.close()
        await reading

    def _grew(self) -> bool:
        """Returns whether the memory grew in the second half by more than a recording needs."""
        middle = len(self.memory) // 2 - 1
        recorded = self.growth * (self._times[-1] - self._times[middle])
        return self.memory[-1] > (1.0 + _MEMORY_GROWTH) * self.memory[middle] + recorded

    async def send(self) -> None:
        """Sends messages over successive connections until all are sent."""
        while self._is_active():
            try:
                socket = await self.connect()
            except Exception:  # No connection is free at the moment.
                await asyncio.sleep(0.1)
                continue
            gone = asyncio.ensure_future(self._listen(socket))
            while self._has_messages() and not gone.done():
                try:
                    await socket.write_message(make_message(self._rng, self._names), binary=True)
                except WebSocketClosedError:
                    break
                self.sent += self._is_counting
                self.before += not self._is_counting
                await asyncio.sleep(0.001)
            self.closed += gone.done()
            socket.close()
            await gone

    async def _listen(self, socket: Any) -> None:
        """Reads the server's messages, for the names of the page's controls."""
        while (data := await socket.read_message()) is not None:
            if len(self._names) < 200 and isinstance(data, bytes):
                self._names += re.findall(
                    r"[0-9a-f]{8}-[0-9a-f-]{27}", data.decode(errors="ignore")
                )

    async def dawdle(self) -> None:
        """Opens connections with incomplete or invalid requests, and delays their end."""
        host, port = re.findall(r"//([^:/]+):(\d+)", self._url)[0]
        while self._is_active():
            try:
                _, writer = await asyncio.open_connection(host, int(port))
                start = self._rng.choice(
                    (b"GET / HTTP/1.1\r\nX: ", b"POST / HTTP/1.1\r\n", b"\x16")
                )
                writer.write(start + self._rng.randbytes(self._rng.choice((1, 100, 40_000))))
                await asyncio.sleep(self._rng.uniform(0.0, 3.0))
                writer.close()
            except OSError:
                await asyncio.sleep(0.1)

    async def run(self) -> list[str]:
        """Runs the attack; returns the findings."""
        wrong = []
        fetch = AsyncHTTPClient().fetch
        for headers in ({"Origin": "http://evil.example"}, {"Host": "evil.example"}):
            answer = await fetch(self._url, headers=headers, raise_error=False)
            if answer.code != 403:
                wrong.append(f"{headers} is answered with {answer.code}")
        if self._settling:
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
    """Returns the memory of a process and its descendants [MiB]."""
    pages = 0
    for one in family(process):
        try:
            pages += int(Path(f"/proc/{one}/statm").read_text().split()[1])
        except OSError:
            continue
    return pages * resource.getpagesize() / 2**20


def server_of(url: str) -> int:
    """Returns the process of the meshcat server with a command address."""
    for entry in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            words = entry.read_bytes().split(b"\0")
        except OSError:
            continue
        if b"pepper_drake.playback.server" in words and url.encode() in words:
            return int(entry.parent.name)
    raise SystemExit(f"no meshcat server at {url}")


def joints_beyond(folder: Path) -> Iterator[str]:
    """Yields joints beyond their limits in the demonstrations and runs below a folder."""
    limits = joint_limits()
    for file in (*folder.rglob("joints.csv"), *folder.rglob("log.npz")):
        for name, column in load_motion(file.parent).positions.items():
            lower, upper = limits.get(name, (-np.inf, np.inf))
            if column.min() < lower - _OVERSHOOT or column.max() > upper + _OVERSHOOT:
                yield f"{file}: {name} goes from {column.min():.3f} to {column.max():.3f} rad"


def write_long(app: str, path: Path) -> None:
    """Writes a movement of the longest duration, for an app that ends with its movement."""
    if app == "reproduce":
        primitive = MovementPrimitive.fit(Demonstration.load(_DEMONSTRATION), num_basis=20)
        primitive.save(path)
        text = path.read_text()
        slow = re.sub("^duration: .*$", f"duration: {LONGEST:g}", text, flags=re.MULTILINE)
        path.write_text(slow)
    else:  # Back and forth repeatedly.
        guide = load_guide("reach")
        there = guide.via_points
        passes = itertools.cycle((there, there[::-1]))
        poses = itertools.chain.from_iterable(passes)
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
    # Files, not pipes: nothing reads during the attack, and a full pipe would block the app.
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
        if options.app == "play":  # Its window stays after its exit.
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
            _SETTLING.get(options.app, 0.0),
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
