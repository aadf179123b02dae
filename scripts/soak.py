"""Reaches, learns and optimises repeatedly in one process, and checks it for leaks.

  soak.py --minutes 60                 an hour
  soak.py --minutes 5 --page           with a page that shows each reach

Each round fits a movement, rolls out 40 variants with the equations and 8 with the kinematics,
reaches once in the full simulation with cameras, and writes and loads its results. Memory, threads
and open files are compared with those after the first rounds. Exit code 1 if the memory grew by
more than 5 % or any thread or file is left.
"""

import argparse
import gc
import os
import resource
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

from pepper_drake.cli import limit_linear_algebra, quiet_libraries
from pepper_drake.diagrams.factory import prepare_scene
from pepper_drake.diagrams.reach_result import save_result
from pepper_drake.diagrams.reach_simulation import ReachSimulation, RunOptions
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.models.pepper import MODELS_DIR
from pepper_drake.models.scene import load_scene
from pepper_drake.optimization import CostWeights, make_task, smooth_bumps
from pepper_drake.optimization.movement_rollouts import make_rollouts
from pepper_drake.playback.loading import load_motion
from pepper_drake.scenario import Scenario, build_reaching
from pepper_drake.web.drake_page import open_meshcat

WARM_UP = 6
"""Rounds before memory is compared: caches fill, the allocator settles."""
ALLOWED = 0.05
"""Allowed relative growth of the memory."""


def usage() -> tuple[float, int, int]:
    """Returns this process's memory [MiB], its threads, and its open files."""
    with open("/proc/self/statm") as statm:
        pages = int(statm.read().split()[1])
    files = len(os.listdir("/proc/self/fd")) - 1
    threads = len(os.listdir("/proc/self/task"))
    return pages * resource.getpagesize() / 2**20, threads, files


def one_round(number: int, scene: str, *, page: bool) -> str:
    """Runs one round; returns the reach's outcome and the size of its cloud."""
    demonstration = Demonstration.load(MODELS_DIR / "demonstrations" / "reach")
    primitive = MovementPrimitive.fit(demonstration)
    rng = np.random.default_rng(number)
    parameters = smooth_bumps(primitive, 4)
    for name, count in (("fast", 40), ("kinematics", 8)):
        cost = CostWeights(hand_to_goal=1.0, deviation=0.1)
        evaluate = make_rollouts(name, parameters, make_task(primitive), cost)
        evaluate(0.01 * rng.standard_normal((count, parameters.size)))
    scenario = Scenario(seed=number)
    scenario.scene = prepare_scene(load_scene(scene))
    with open_meshcat(page=page) as (meshcat, _):
        options = RunOptions(meshcat=meshcat if page or number % 4 == 0 else None, progress=False)
        result = ReachSimulation(build_reaching(scenario), options).run()
    with tempfile.TemporaryDirectory() as folder:
        save_result(result, Path(folder))
        load_motion(Path(folder))
    report = result.report
    return f"{scene} {report.outcome}, cloud of {report.cloud.points} points"


def wait_for_renderers() -> None:
    """Waits until the threads of unused renderers have ended."""
    gc.collect()
    end = time.monotonic() + 20.0
    while time.monotonic() < end and any(
        thread.name.startswith("renderer") for thread in threading.enumerate()
    ):
        time.sleep(0.05)


def main() -> int:
    """Runs the program."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--scenes", nargs="+", default=["free", "table"], help="in turns")
    parser.add_argument("--page", action="store_true", help="with a page in each round")
    options = parser.parse_args()
    limit_linear_algebra()
    quiet_libraries()
    end = time.monotonic() + 60.0 * options.minutes
    rounds: list[tuple[float, int, int]] = []
    began = time.monotonic()
    while time.monotonic() < end or len(rounds) < WARM_UP + 2:
        scene = options.scenes[len(rounds) % len(options.scenes)]
        outcome = one_round(len(rounds), scene, page=options.page)
        wait_for_renderers()
        rounds.append(usage())
        memory, threads, files = rounds[-1]
        print(
            f"round {len(rounds)} at {time.monotonic() - began:.0f} s: {outcome}, "
            f"{memory:.0f} MiB, {threads} threads, {files} files",
            flush=True,
        )
    warm, last = rounds[WARM_UP - 1], rounds[-1]
    largest = max(memory for memory, _, _ in rounds[WARM_UP - 1 :])
    grown = largest / warm[0] - 1.0
    left = last[1] - warm[1], last[2] - warm[2]
    print(
        f"{len(rounds)} rounds: memory {warm[0]:.0f} MiB after {WARM_UP}, at most {largest:.0f} "
        f"({grown:+.1%}); {left[0]} threads and {left[1]} files left"
    )
    return 1 if grown > ALLOWED or any(number > 0 for number in left) else 0


if __name__ == "__main__":
    sys.exit(main())
