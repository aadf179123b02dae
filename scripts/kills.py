"""Kills apps at random moments, and checks that all their files are complete.

  kills.py                          50 moments of every app that writes
  kills.py reach optimize --moments 10

Every other end is by SIGKILL, the others by SIGTERM. All runs of an app write into one folder, one
after the other, each in a fork of a process that has imported the app: before that there is nothing
to lose. After each, every file there must be readable, and no process of the run may be left; after
SIGTERM the app must have ended within 30 s, with at most two lines and exit code 0 or 130. The
first and the last run are not killed: both must succeed, with the same files. Exit code 1 at a
finding.
"""

import argparse
import contextlib
import json
import os
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator
from pathlib import Path

import cv2
from app_process import family, run_each_apart, running, start_app

from pepper_drake import cli
from pepper_drake.__main__ import load_app
from pepper_drake.array_files import read_npz
from pepper_drake.errors import InputError
from pepper_drake.learning.demonstrations.recording import PARTIAL, recover
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
    "reach": ("--scene", "free", "--no-recording", "--set", "station.cameras=false"),
    "faults": (*("--signals", "depth", "--starts", "0", "--scenes", "free,table", "--jobs", "2"),),
    "play": (_DEMONSTRATION, "--html", "page.html"),
    "describe": (),
    "diagram": (),
    "perceive": ("--frames", "1", "--samples", "1", "--poses", "1"),
    "benchmark": ("--methods", "a", "--scenes", "1"),
    "calibrate": ("--postures", "8"),
    "teach": ("--no-cameras",),
    "serve_naoqi": ("--port", "0"),
    "preflight": ("--measure", "--disable-life", "--robot"),
}
"""Options for quick runs; apps with pages end only by the signal. A final `--robot` gets the
address of a robot that is served meanwhile."""

_ENDLESS = {"teach": 20.0, "serve_naoqi": 20.0}
"""Apps that run until they are ended, and the time that they get [s]."""

_INTERRUPTED = (0, 130)
_TIMEOUT = 30.0
_LONGEST = 600.0
_CHILDREN_TIMEOUT = 5.0
"""Timeout of an app's child processes after its end [s]."""


def broken(folder: Path) -> list[str]:
    """Returns the files below a folder that cannot be read; recovers an interrupted recording."""
    found = []
    if (folder / PARTIAL).exists():
        try:
            recover(folder)
        except InputError as error:
            if "before it held a motion" not in str(error):
                found.append(str(error))
            (folder / PARTIAL).unlink()
    for path in sorted(folder.rglob("*")):
        if not path.is_file() or ".unfinished-" in str(path):
            continue  # Incomplete results are in a folder of this name.
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


def start(app: str, folder: Path, options: tuple[str, ...]) -> tuple[int, Path]:
    """Starts an app in a fork of this process, which has imported it.

    Returns:
        The process, and the file of its standard error.
    """
    errors = folder.with_suffix(".errors")
    process = os.fork()
    if process:
        return process, errors
    os.setsid()
    for target, mode in ((0, os.O_RDONLY), (1, os.O_WRONLY), (2, os.O_WRONLY | os.O_CREAT)):
        path = errors if target == 2 else os.devnull
        os.dup2(os.open(path, mode | (os.O_TRUNC if target == 2 else 0), 0o600), target)
    sys.argv = [f"{app}.py", *options, "--quiet", "--output", str(folder)]
    code = 1
    try:
        cli.run(load_app(app).main)
    except SystemExit as error:
        code = int(error.code or 0)
    except BaseException:
        traceback.print_exc()
    sys.stderr.flush()
    os._exit(code)


def wait(process: int, seconds: float) -> int | None:
    """Waits for a process; returns its exit code, or minus its signal; None at the timeout."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        ended, status = os.waitpid(process, os.WNOHANG)
        if ended:
            return os.waitstatus_to_exitcode(status)
        time.sleep(0.01)
    return None


def whole_run(
    app: str, folder: Path, options: tuple[str, ...]
) -> tuple[int | None, set[str], list[str]]:
    """Runs an app to its end; returns its exit code, its files' names, and its error lines."""
    process, errors = start(app, folder, options)
    code = wait(process, _ENDLESS.get(app, _LONGEST))
    if code is None:
        os.kill(process, signal.SIGTERM)
        code = wait(process, _TIMEOUT)
    names = {entry.name for entry in folder.iterdir()} if folder.exists() else set()
    return code, names, lines_of(errors)


def lines_of(errors: Path) -> list[str]:
    """Returns the lines of an app's standard error."""
    return errors.read_text().strip().splitlines() if errors.exists() else []


def end_once(process: int, errors: Path, after: float, number: int) -> str:
    """Sends an app a signal after some time; returns the finding, or ""."""
    if wait(process, after) is not None:
        return ""
    others = family(process) - {process}
    os.kill(process, number)
    code = wait(process, _TIMEOUT)
    if code is None:
        os.kill(process, signal.SIGKILL)
        wait(process, _TIMEOUT)
        return f"did not end within {_TIMEOUT:g} s"
    end = time.monotonic() + _CHILDREN_TIMEOUT
    while (left := [one for one in others if running(one)]) and time.monotonic() < end:
        time.sleep(0.05)
    if left:
        return f"{len(left)} processes outlive it: {command_line(left[0])[:80]}"
    lines = lines_of(errors)
    if number == signal.SIGTERM and code not in (*_INTERRUPTED, -signal.SIGTERM):
        return f"exit code {code}: {lines[-1:]}"
    return f"{len(lines)} lines: {lines[-1]}" if len(lines) > 2 else ""


def command_line(process: int) -> str:
    """Returns the command line of a process, or a note that it has ended."""
    try:
        return Path(f"/proc/{process}/cmdline").read_bytes().replace(b"\0", b" ").decode()
    except OSError:
        return f"process {process}, which has ended meanwhile"


@contextlib.contextmanager
def served_robot(folder: Path) -> Iterator[str]:
    """Serves a simulated robot, and yields its address."""
    process = start_app("serve_naoqi", folder, "--port", "0", stdout=subprocess.PIPE, stderr=None)
    try:
        assert process.stdout is not None
        yield re.findall(r"served at ([^ ,]+)", process.stdout.readline())[0]
    finally:
        process.terminate()
        process.wait(_TIMEOUT)


def try_app(
    app: str, options: tuple[str, ...], moments: int, rng: random.Random, folder: Path
) -> int:
    """Kills an app at random moments; returns the number of findings."""
    load_app(app)
    began = time.monotonic()
    code, left, lines = whole_run(app, folder, options)
    if code not in (_INTERRUPTED if app in _ENDLESS else (0,)):
        print(f"{app}: the first run ended with {code}: {lines[-1:]}", flush=True)
        return 1
    duration, findings = time.monotonic() - began, 0
    for moment in range(moments):
        number = signal.SIGKILL if moment % 2 else signal.SIGTERM
        after = rng.uniform(0.0, 1.0) * duration
        wrong = end_once(*start(app, folder, options), after, number)
        for words in (*broken(folder), *([wrong] if wrong else [])):
            findings += 1
            print(f"{app}, {signal.Signals(number).name} after {after:.1f} s: {words}", flush=True)
    last_code, last, lines = whole_run(app, folder, options)
    last.discard("interrupted")
    if (last_code, last) != (code, left):
        findings += 1
        print(
            f"{app}: the last run ended with {last_code} and {last}, not {code} and {left}: "
            f"{lines[-1:]}"
        )
    print(f"{app:12} {moments} ends within {duration:.1f} s: {findings} findings", flush=True)
    return findings


def _try_apart(app: str, moments: int, seed: int) -> None:
    """Tests an app in a process that has imported no other; exits with 1 at a finding."""
    with tempfile.TemporaryDirectory() as folder:
        results, rng = Path(folder) / "results", random.Random(f"{seed} {app}")
        if APPS[app][-1:] == ("--robot",):
            with served_robot(Path(folder) / "robot") as address:
                findings = try_app(app, (*APPS[app], address), moments, rng, results)
        else:
            findings = try_app(app, APPS[app], moments, rng, results)
    sys.exit(1 if findings else 0)


def main() -> int:
    """Runs the program."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("apps", nargs="*", help=f"default: all of {', '.join(APPS)}")
    parser.add_argument("--moments", type=int, default=50, help="of each app")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    cli.quiet_resource_tracker()  # All forks of this program share it.
    for app in options.apps:
        if app not in APPS:
            parser.error(f'"{app}" is unknown; there are {", ".join(APPS)}')
    return run_each_apart(_try_apart, options.apps or APPS, options.moments, options.seed)


if __name__ == "__main__":
    sys.exit(main())
