"""Ends apps at random moments, and tells whether all that they leave is whole.

  kills.py                          50 moments of every app that writes
  kills.py reach optimize --moments 10

Every other end is by SIGKILL, the others by SIGTERM. All runs of an app write into one folder,
one after the other. After each, every file there must be readable; after SIGTERM the app must have
ended within 30 s, with two lines at most and exit code 0 or 130. At last a run is left alone: it
must leave what the first one left. Exit code 1 at a finding.
"""

import argparse
import json
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import cv2
from app_process import start_app

from pepper_drake.array_files import read_npz
from pepper_drake.errors import InputError
from pepper_drake.yaml_files import read_yaml

_DEMONSTRATION = "pepper_drake/models/demonstrations/reach"

APPS: dict[str, tuple[str, ...]] = {
    "learn": (_DEMONSTRATION,),
    "record": (),
    "reproduce": (),
    "chain": (_DEMONSTRATION, _DEMONSTRATION),
    "import": (f"{_DEMONSTRATION}/translation.txt",),
    "optimize": (_DEMONSTRATION, "--goal-offset", "0", "0.05", "0.05"),
    "compare": (),
    "reach": ("--scene", "free", "--no-recording"),
    "perceive": ("--frames", "1", "--samples", "1", "--poses", "1"),
    "benchmark": ("--methods", "a", "--scenes", "1"),
    "calibrate": ("--postures", "8"),
    "teach": ("--no-cameras",),
    "serve_naoqi": ("--port", "9871"),
}
"""Options with which an app is quick; those of pages end only by the signal."""

_ENDLESS = {"teach": 20.0, "serve_naoqi": 20.0}
"""Apps that go on until they are ended, and how long they are let [s]."""

_INTERRUPTED = (0, 130)
_PATIENCE = 30.0
_LONGEST = 600.0


def broken(folder: Path) -> list[str]:
    """Returns the files below a folder that cannot be read."""
    found = []
    for path in sorted(folder.rglob("*")):
        if not path.is_file() or ".unfinished-" in str(path):
            continue  # What was being written is in a folder of that name until it is whole.
        try:
            if path.suffix == ".json":
                json.loads(path.read_text())
            elif path.suffix == ".npz":
                read_npz(path, kinds="fiubU")
            elif path.suffix in (".yaml", ".yml"):
                read_yaml(path, 2**24)
            elif path.suffix == ".png" and cv2.imread(str(path)) is None:
                raise ValueError("no picture")
            elif path.suffix == ".html" and "</html>" not in path.read_text()[-200:]:
                raise ValueError("no end")
        except (InputError, ValueError) as error:
            found.append(f"{path}: {error}")
    return found


def whole_run(app: str, folder: Path, options: tuple[str, ...]) -> tuple[int, set[str]]:
    """Lets an app do its work; returns its exit code and the names of what it left."""
    process = start_app(app, folder, *options, "--quiet")
    try:
        process.communicate(timeout=_ENDLESS.get(app, _LONGEST))
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=_PATIENCE)
    names = {entry.name for entry in folder.iterdir()} if folder.exists() else set()
    return process.returncode, names


def end_once(process: subprocess.Popen[str], after: float, number: int) -> str:
    """Ends an app; returns what was wrong with how it ended."""
    try:
        process.communicate(timeout=after)
        return ""
    except subprocess.TimeoutExpired:
        process.send_signal(number)
    try:
        _, errors = process.communicate(timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return f"did not end within {_PATIENCE:g} s"
    lines = errors.strip().splitlines()
    if number == signal.SIGTERM and process.returncode not in (*_INTERRUPTED, -signal.SIGTERM):
        return f"exit code {process.returncode}: {lines[-1:]}"
    # A process that has not yet come to our code ends as Python's own do.
    return f"{len(lines)} lines: {lines[-1]}" if len(lines) > 2 else ""


def try_app(app: str, moments: int, dice: random.Random, folder: Path) -> int:
    """Ends an app at random moments; returns the number of findings."""
    options = APPS[app]
    began = time.monotonic()
    code, left = whole_run(app, folder, options)
    duration, findings = time.monotonic() - began, 0
    for moment in range(moments):
        number = signal.SIGKILL if moment % 2 else signal.SIGTERM
        after = dice.uniform(0.05, 1.0) * duration
        wrong = end_once(start_app(app, folder, *options, "--quiet"), after, number)
        for words in (*broken(folder), *([wrong] if wrong else [])):
            findings += 1
            print(f"{app}, {signal.Signals(number).name} after {after:.1f} s: {words}", flush=True)
    last_code, last = whole_run(app, folder, options)
    last.discard("interrupted")
    if (last_code, last) != (code, left):
        findings += 1
        print(f"{app}: the last run ended with {last_code} and {last}, not {code} and {left}")
    print(f"{app:12} {moments} ends within {duration:.0f} s: {findings} findings", flush=True)
    return findings


def main() -> int:
    """Runs the program."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("apps", nargs="*", help=f"default: all of {', '.join(APPS)}")
    parser.add_argument("--moments", type=int, default=50, help="of each app")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    dice, findings = random.Random(options.seed), 0
    for app in options.apps or APPS:
        if app not in APPS:
            parser.error(f'"{app}" is unknown; there are {", ".join(APPS)}')
        with tempfile.TemporaryDirectory() as folder:
            findings += try_app(app, options.moments, dice, Path(folder) / "results")
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
