"""Period and jitter of the commands to a robot, compared with a bare timer.

    python benchmarks/command_period.py --seconds 60

A kinematic robot is served by its own process; a station's link sends it a command every 20 ms.
Prints the median period and the 99th percentile of |period - 20 ms|, at the receiver, of both.
Exit code 0: the median is 20.0 ms and the jitter at most 2 ms above the timer's; 1: otherwise.
"""

import argparse
import multiprocessing
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "hardware"))

from served import served, stand

from pepper_drake.hardware.link_config import LinkConfig
from pepper_drake.hardware.link_process import LinkProcess
from pepper_drake.hardware.mailbox import STREAM
from pepper_drake.hardware.preflight import PreflightOptions
from pepper_drake.hardware.transport import LINKS, RobotAccess
from pepper_drake.models.pepper import BODY_JOINTS
from pepper_drake.naoqi.constants import CYCLE

MARGIN = 0.002
"""Allowed jitter above the timer's [s]."""


def serve(pipe: Connection) -> None:
    """Serves a robot that records the arrival time of each command."""
    with served() as robot:
        robot.do(lambda: stand(robot))
        motion, arrivals = robot.pepper.motion, []
        set_targets = motion.joints.set_targets

        def record_arrival(*arguments: Any, **options: Any) -> Any:
            arrivals.append(time.monotonic())
            return set_targets(*arguments, **options)

        motion.joints.set_targets = record_arrival
        pipe.send(robot.address)
        pipe.recv()
        pipe.send(arrivals)


def run_timer(seconds: float, pipe: Connection) -> None:
    """Wakes every 20 ms and records the times."""
    times, due = [], time.monotonic()
    end = due + seconds
    while due < end:
        due += CYCLE
        time.sleep(max(due - time.monotonic(), 0.0))
        times.append(time.monotonic())
    pipe.send(times)


def periods(times: list[float]) -> tuple[float, float]:
    """Returns the median period and the 99th percentile of its deviation from 20 ms [ms]."""
    between = np.diff(times)
    return 1e3 * float(np.median(between)), 1e3 * float(np.percentile(np.abs(between - CYCLE), 99))


def main() -> int:
    """Runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--link", choices=LINKS, default="wire")
    options = parser.parse_args()
    context = multiprocessing.get_context("spawn")
    robot, server_end = context.Pipe()
    timer, timer_end = context.Pipe()
    context.Process(target=serve, args=(server_end,), daemon=True).start()
    address = robot.recv()
    config, checks = LinkConfig("right", late_cycles=10**6), PreflightOptions(disable_life=True)
    with LinkProcess(RobotAccess(address, link=options.link), config, checks) as link:
        link.wait_until_ready()
        here = np.array(link.state()["positions"])
        context.Process(target=run_timer, args=(options.seconds, timer_end), daemon=True).start()
        begin = time.monotonic()
        row = BODY_JOINTS.index("RElbowYaw")
        while (now := time.monotonic() - begin) < options.seconds:
            wanted, rate = here.copy(), np.zeros(len(here))
            wanted[row] += 0.3 * (1 - np.cos(now))
            rate[row] = 0.3 * np.sin(now)
            link.command(mode=STREAM, positions=wanted, velocities=rate)
            time.sleep(CYCLE / 2)
        fault = str(link.state()["fault"])
    robot.send(None)
    arrivals = [t for t in robot.recv() if begin + 1.0 < t < begin + options.seconds]
    (median, jitter), (_, bare) = periods(arrivals), periods(timer.recv())
    print(f"commands {len(arrivals)}: median period {median:.2f} ms, jitter's 99th {jitter:.2f} ms")
    print(f"bare timer: jitter's 99th {bare:.2f} ms; difference {jitter - bare:.2f} ms")
    if fault:
        print(f"the link ended: {fault}")
    good = abs(median - 20.0) < 0.05 and jitter <= bare + 1e3 * MARGIN and not fault
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
