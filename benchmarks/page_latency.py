"""Latency of the teaching page from a drag to the motion, and its frame rate.

A client on this computer connects to the page as a browser does, through its guard: it drags the
hand to and fro, and each time waits until the page shows that motion. A browser's drawing time,
which depends on its graphics card, comes on top.

    .venv/bin/python benchmarks/page_latency.py [--cameras] [--drags N]
"""

import argparse
import json
import os
import threading
import time
from collections import deque

import msgpack
import numpy as np
import viser
import zstandard
from websockets.sync.client import ClientConnection, connect

from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.live.controls import KEYS
from pepper_drake.live.page import LivePage
from pepper_drake.live.session import LiveSession
from pepper_drake.live.show import LiveApp
from pepper_drake.live.simulation import LiveSimulation
from pepper_drake.models.scene import SCENES_DIR, load_scene
from pepper_drake.web.viser_page import ViserPage

STEP = 0.06
"""Length of a drag [m]."""
MOVED = 0.0005
"""Displacement of the forearm that counts as motion [m]."""
REST = 1.5
"""Time from one drag to the next [s]."""
CAMERA = {
    "wxyz": [1.0, 0.0, 0.0, 0.0],
    "position": [1.0, 0.0, 1.0],
    "fov": 1.0,
    "near": 0.1,
    "far": 100.0,
    "image_height": 600,
    "image_width": 800,
    "look_at": [0.0, 0.0, 0.0],
    "up_direction": [0.0, 0.0, 1.0],
}


def messages(value):
    """Yields the messages in unpacked data of viser."""
    if isinstance(value, dict):
        if "type" in value:
            yield value
        else:
            for entry in value.values():
                yield from messages(entry)
    elif isinstance(value, list | tuple):
        for entry in value:
            yield from messages(entry)


def unpacked(data):
    """Unpacks data of viser's server: two lengths, compressed messages, and large arrays."""
    length = int.from_bytes(data[8:16], "little")
    return msgpack.unpackb(zstandard.ZstdDecompressor().decompress(data[16 : 16 + length]))


class Watcher(threading.Thread):
    """Reads the page's messages, and records positions of a body with their arrival times."""

    def __init__(self, socket: ClientConnection, body: str) -> None:
        super().__init__(daemon=True)
        self.socket, self.body = socket, body
        self.positions = deque(maxlen=5000)

    def run(self):
        for data in self.socket:
            for message in messages(unpacked(data)):
                position = message.get("position") or message.get("updates", {}).get("position")
                if position is not None and str(message.get("name", "")).endswith(self.body):
                    at = np.frombuffer(position) if isinstance(position, bytes) else position
                    self.positions.append((time.perf_counter(), np.array(at, dtype=float)))


def drag(app, watcher, say, offset, home):
    """Drags the hand by an offset (3,) [m]; returns the latency until it was seen to move [s]."""
    X_WG = app.session.simulation.torso_pose() @ home
    upward = 1.0 if offset[2] > 0.0 else -1.0
    began = time.perf_counter()
    say(
        "TransformControlsUpdateMessage",
        name="/hand",
        owner="",
        wxyz=X_WG.rotation().ToQuaternion().wxyz().tolist(),
        position=(X_WG.translation() + offset).tolist(),
    )
    while time.perf_counter() < began + REST:
        app.step()
    # The previous motion may not be over: the new one starts at its turning point.
    lowest, seen = np.inf, None
    for moment, position in list(watcher.positions):
        if moment > began and seen is None:
            along = upward * position[2]
            lowest = min(lowest, along)
            if along > lowest + MOVED:
                seen = moment - began
    return seen


def quantiles(values):
    """Returns median and 90th percentile; None without values."""
    if not values:
        return None
    median, most = np.quantile(values, (0.5, 0.9))
    return {"median": round(float(median), 1), "90 %": round(float(most), 1)}


def measure(*, cameras: bool, drags: int) -> dict:
    """Runs a session with its page in this process, as teach.py does, and drags its hand."""
    simulation = LiveSimulation(
        load_scene(SCENES_DIR / "teach.yaml"),
        config=ReachingConfig(station=StationConfig(cameras=cameras)),
        spares=True,
        realtime=True,
    )
    with ViserPage(keys=KEYS) as page:
        app = LiveApp(LiveSession(simulation), LivePage(page, cameras=cameras, spares=True))
        socket = connect(
            page.url.replace("http:", "ws:"),
            subprotocols=[f"viser-v{viser.__version__}"],
            max_size=None,
            close_timeout=0.2,
        )

        def say(kind, **fields):
            socket.send(msgpack.packb({"type": kind, **fields}))

        say("ViewerCameraMessage", **CAMERA)
        hand = "r_wrist"
        watcher = Watcher(socket, hand)
        watcher.start()
        simulation.begin()
        end = time.perf_counter() + 3.0
        while time.perf_counter() < end:
            app.step()
        home, before = app.target, simulation.pace
        delays = []
        for number in range(drags):
            offset = np.array([0.0, 0.0, 0.0 if number % 2 else STEP])
            delays.append(drag(app, watcher, say, offset, home))
        pace = simulation.pace
        socket.close()
    wall = pace.wall_seconds - before.wall_seconds
    seen = [1000 * delay for delay in delays if delay is not None]
    return {
        "cameras": cameras,
        "drags": drags,
        "seen": len(seen),
        "drag_to_motion_ms": quantiles(seen),
        "frames_per_second": round((pace.frames - before.frames) / wall, 1),
        "realtime_rate": round((pace.simulated_seconds - before.simulated_seconds) / wall, 2),
        "load_average": [round(load, 1) for load in os.getloadavg()],
        "cores": os.cpu_count(),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cameras", action="store_true", help="render the head's cameras")
    parser.add_argument("--drags", type=int, default=20)
    options = parser.parse_args()
    print(json.dumps(measure(cameras=options.cameras, drags=options.drags), indent=2))


if __name__ == "__main__":
    main()
