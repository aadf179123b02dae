"""Startup time of play.py with a run of 10 s, as a process with its imports."""

import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.playback.run_example import make_run

ROOT = Path(__file__).parents[1]
PLAY = [sys.executable, str(ROOT / "apps" / "play.py")]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return str(make_run(tmp_path_factory.mktemp("runs") / "ten_seconds", seconds=10.0))


@pytest.fixture
def address():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp://127.0.0.1:{probe.getsockname()[1]}"


@pytest.mark.parametrize("window", ["closed", "open"])
def test_a_run_is_opened(benchmark, run, address, window):
    """Starts the window's server first, or draws into an open window."""
    command = [*PLAY, run, "--quiet", "--zmq-url", address]
    stop = [*PLAY, "--stop", "--zmq-url", address]

    def close():
        subprocess.run(stop, check=True)

    if window == "open":
        subprocess.run(command, check=True)
        benchmark.pedantic(subprocess.run, args=(command,), kwargs={"check": True}, rounds=5)
        close()
    else:
        benchmark.pedantic(
            subprocess.run,
            args=(command,),
            kwargs={"check": True},
            rounds=5,
            teardown=lambda *_, **__: close(),
        )


def test_the_imports_alone(benchmark):
    """Imports of any program that shows Drake's shapes in meshcat."""
    program = "import meshcat, numpy, pydrake.multibody.parsing"
    command = [sys.executable, "-c", program]
    benchmark.pedantic(subprocess.run, args=(command,), kwargs={"check": True}, rounds=5)
