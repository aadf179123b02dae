"""Round-trip time of calls to our server and to libqi's, with libqi's client.

    python benchmarks/naoqi_calls.py

Needs the extra `naoqi`. Both servers and the client run in their own processes; the servers take
turns, so other load on the machine affects both.
"""

import asyncio
import json
import subprocess
import sys
import threading

import numpy as np

CALLS = {"angles": 400, "depth": 200, "image": 100}
ROUNDS = 4
_ANGLES = [0.1 * k for k in range(20)]
_SIZES = {"image": (640, 480, 3, 11), "depth": (320, 240, 2, 17)}


def reply(name: str) -> list:
    """Returns a reply of `getImageRemote` (see the manufacturer's documentation)."""
    width, height, layers, space = _SIZES[name]
    data = np.random.default_rng(0).integers(0, 256, width * height * layers, np.uint8).tobytes()
    return [width, height, layers, space, 0, 0, data, 0, 0.5, -0.4, -0.5, 0.4]


def serve_ours() -> None:
    """Serves the three methods until standard input ends."""
    from pepper_drake.robot_server.wire.server import QiServer
    from pepper_drake.robot_server.wire.service import Service

    async def run() -> None:
        service = Service("Timed")
        replies = {name: reply(name) for name in _SIZES}
        service.add_method("angles", "()", "[f]", lambda: _ANGLES)
        service.add_method("image", "()", "m", lambda: replies["image"])
        service.add_method("depth", "()", "m", lambda: replies["depth"])
        server = QiServer([service], port=0)
        await server.start()
        print(server.address, flush=True)
        await asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
        await server.close()

    asyncio.run(run())


def serve_libqi() -> None:
    """Serves the same from libqi, whose Python returns raw bytes only by an explicit signature."""
    import qi

    qi.logging.setLevel(qi.logging.FATAL)
    replies = {name: tuple(reply(name)) for name in _SIZES}

    class Timed:
        @qi.bind("[f]", ())
        def angles(self):
            return _ANGLES

        @qi.bind("(iiiiiiriffff)", ())
        def image(self):
            return replies["image"]

        @qi.bind("(iiiiiiriffff)", ())
        def depth(self):
            return replies["depth"]

    qi.Application(["timed"], raw=True)
    session = qi.Session()
    session.listenStandalone("tcp://127.0.0.1:0")
    session.registerService("Timed", Timed())
    print(session.endpoints()[0], flush=True)
    sys.stdin.read()
    import os

    os._exit(0)


def measure(address: str) -> None:
    """Prints the duration of each call [s], as JSON."""
    import os
    import time

    import qi

    qi.logging.setLevel(qi.logging.FATAL)
    qi.Application(["client"], raw=True)
    session = qi.Session()
    session.connect(address)
    service = session.service("Timed")
    found = {}
    for name, count in CALLS.items():
        call = getattr(service, name)
        times = []
        for _ in range(count):
            begin = time.perf_counter()
            call()
            times.append(time.perf_counter() - begin)
        found[name] = times[count // 10 :]
    print(json.dumps(found), flush=True)
    os._exit(0)


def main() -> None:
    """Prints the medians of both servers and their ratio."""
    servers = {}
    for kind in ("ours", "libqi"):
        servers[kind] = subprocess.Popen(
            [sys.executable, __file__, kind],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
    addresses = {kind: server.stdout.readline().strip() for kind, server in servers.items()}
    for server in servers.values():
        threading.Thread(target=server.stdout.read, daemon=True).start()
    times = {kind: {name: [] for name in CALLS} for kind in servers}
    for _ in range(ROUNDS):
        for kind, address in addresses.items():
            out = subprocess.run(
                [sys.executable, __file__, "measure", address],
                capture_output=True,
                text=True,
                check=True,
            ).stdout
            for name, found in json.loads(out.splitlines()[-1]).items():
                times[kind][name] += found
    for server in servers.values():
        server.stdin.close()
        server.wait(10)
    print(f"{'call':8}{'ours [ms]':>12}{'libqi [ms]':>12}{'ratio':>8}")
    for name in CALLS:
        ours, theirs = (1e3 * np.median(times[kind][name]) for kind in ("ours", "libqi"))
        print(f"{name:8}{ours:12.2f}{theirs:12.2f}{ours / theirs:8.2f}")


if __name__ == "__main__":
    if sys.argv[1:2] == ["ours"]:
        serve_ours()
    elif sys.argv[1:2] == ["libqi"]:
        serve_libqi()
    elif sys.argv[1:2] == ["measure"]:
        measure(sys.argv[2])
    else:
        main()
