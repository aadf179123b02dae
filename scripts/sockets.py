"""Starts every app and lists the addresses at which it listens.

  sockets.py                 all apps, without a page and with one
  sockets.py reach teach     these

By default an app may listen on loopback only, and not at all without a page or server. Exit code 1
if one does otherwise, or has not begun in time.
"""

import argparse
import os
import re
import signal
import sys
import tempfile
import time
from ipaddress import IPv4Address, IPv6Address, ip_address
from pathlib import Path

from app_process import family, start_app

_DEMONSTRATION = "pepper_drake/models/demonstrations/reach"

RUNS: tuple[tuple[bool, tuple[str, ...]], ...] = (
    (False, ("benchmark", "--methods", "a", "--scenes", "1")),
    (False, ("calibrate", "--postures", "8")),
    (False, ("chain", _DEMONSTRATION, _DEMONSTRATION)),
    (False, ("compare",)),
    (False, ("describe",)),
    (False, ("diagram",)),
    (False, ("faults", "--scenes", "free", "--signals", "depth", "--starts", "0")),
    (False, ("import", f"{_DEMONSTRATION}/translation.txt")),
    (False, ("learn", _DEMONSTRATION)),
    (False, ("optimize", _DEMONSTRATION, "--goal-offset", "0", "0.05", "0.05", "--jobs", "2")),
    (False, ("perceive", "--frames", "1", "--samples", "1", "--poses", "1")),
    (False, ("reach",)),
    (False, ("record",)),
    (False, ("reproduce",)),
    (True, ("perceive", "--live")),
    (True, ("play", _DEMONSTRATION)),
    (True, ("reach", "--live")),
    (True, ("record", "--live")),
    (True, ("reproduce", "--live")),
    (True, ("serve_naoqi", "--port", "9873")),
    (True, ("teach",)),
)
"""Command lines, and whether they have a page or a server."""

_AFTER_PAGE = 5.0
"""Time for which an app is watched after its page has appeared [s]."""

_STARTING = 180.0
"""Timeout until an app begins, or shows its page [s]."""

_LISTENING = "0A"
"""State of a listening socket in /proc/net/tcp."""


def listening(processes: set[int]) -> set[str]:
    """Returns the addresses at which processes listen, without their ports."""
    inodes = set()
    for process in processes:
        for entry in Path(f"/proc/{process}/fd").glob("*"):
            try:
                inodes.add(os.readlink(entry))
            except OSError:
                continue
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            words = line.split()
            if words[3] == _LISTENING and f"socket:[{words[9]}]" in inodes:
                found.add(str(_address(words[1].partition(":")[0])))
    return found


def _address(text: str) -> IPv4Address | IPv6Address:
    """Parses an address of /proc, whose groups of four bytes are in the machine's byte order."""
    content = bytes.fromhex(text)
    groups = [content[k : k + 4][::-1] for k in range(0, len(content), 4)]
    return ip_address(b"".join(groups))


def has_begun(process: int) -> bool:
    """Returns whether an app has finished its imports: it then handles SIGTERM."""
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return False
    caught = next(line for line in status.splitlines() if line.startswith("SigCgt:"))
    return bool(int(caught.split()[1], 16) >> (signal.SIGTERM - 1) & 1)


def watch(
    arguments: tuple[str, ...], seconds: float, folder: Path, *, has_page: bool
) -> tuple[set[str], str]:
    """Runs an app for some time after it has begun, or after its page has appeared.

    Returns:
        The addresses at which it listened, and how it ended.
    """
    process = start_app(arguments[0], folder, *arguments[1:])
    found: set[str] = set()
    waits, end = True, time.monotonic() + _STARTING
    while time.monotonic() < end and process.poll() is None:
        found |= listening(family(process.pid))
        if waits and (found if has_page else has_begun(process.pid)):
            waits, end = False, time.monotonic() + (_AFTER_PAGE if has_page else seconds)
        time.sleep(0.05)
    if process.poll() is None:
        process.send_signal(signal.SIGTERM)
    _, errors = process.communicate(timeout=60.0)
    lines = errors.strip().splitlines()
    return found, f"exit code {process.returncode}" + (f", {lines[-1][:80]}" if lines else "")


def main() -> int:
    """Runs the program."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("apps", nargs="*", help="default: all")
    parser.add_argument(
        "--seconds", type=float, default=60.0, help="each is watched so long once it has begun"
    )
    options = parser.parse_args()
    findings = 0
    for has_page, arguments in RUNS:
        if options.apps and arguments[0] not in options.apps:
            continue
        with tempfile.TemporaryDirectory() as folder:
            found, end = watch(
                arguments, options.seconds, Path(folder) / "results", has_page=has_page
            )
        outside = {one for one in found if not ip_address(one).is_loopback}
        # A run that timed out before it began, or refused its options, proves nothing.
        began = not re.search(rf"exit code ({-signal.SIGTERM}|2)\b", end)
        is_wrong = bool(outside) or bool(found) != has_page or not began
        findings += is_wrong
        print(
            f"{'FINDING ' if is_wrong else ''}{' '.join(arguments)[:60]:60} "
            f"{', '.join(sorted(found)) or 'nowhere'} ({end})",
            flush=True,
        )
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
