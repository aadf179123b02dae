"""Apps in separate processes, for scripts that watch them."""

import multiprocessing
import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import IO

ROOT = Path(__file__).parents[1]


def start_app(
    app: str,
    folder: Path | str,
    *options: str,
    stdout: int | IO[str] = subprocess.DEVNULL,
    stderr: int | IO[str] = subprocess.PIPE,
) -> subprocess.Popen[str]:
    """Starts an app that writes into a folder.

    A pipe must be read while the app runs: an app blocks once 64 KiB are unread.

    Args:
        app: Its name.
        folder: Output folder.
        options: Other options, and arguments.
        stdout: As `subprocess.Popen` takes it.
        stderr: As `subprocess.Popen` takes it.
    """
    return subprocess.Popen(
        [sys.executable, "-u", f"apps/{app}.py", *options, "--output", str(folder)],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdin=subprocess.DEVNULL,
        stdout=stdout,
        stderr=stderr,
        text=True,
    )


def family(process: int) -> set[int]:
    """Returns a process and all its descendants."""
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                words = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            parents.setdefault(int(words[1]), []).append(int(entry.name))
    found, waiting = set(), [process]
    while waiting:
        one = waiting.pop()
        found.add(one)
        waiting += parents.get(one, [])
    return found


def running(process: int) -> bool:
    """Returns whether a process exists and has not ended."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def run_each_apart(function: Callable[..., None], names: Iterable[str], *given: int) -> int:
    """Runs a function with each name and further arguments, each time in a new process.

    Returns:
        1 if one of them ended with an exit code other than 0.
    """
    codes = []
    for name in names:
        process = multiprocessing.get_context("spawn").Process(target=function, args=(name, *given))
        process.start()
        process.join()
        codes.append(process.exitcode)
    return int(any(codes))
