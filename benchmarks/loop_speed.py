"""Speed of the loop: one control tick, the calls of the planner, and the whole diagram.

    python benchmarks/loop_speed.py tick
    python benchmarks/loop_speed.py planner --scenes 8
    python benchmarks/loop_speed.py diagram --until 8
    python benchmarks/loop_speed.py profile --until 8
    python benchmarks/loop_speed.py tick planner diagram --save

With --save the figures replace those in benchmarks/speed.json, from which
`scripts/publish_speed.py` writes the tables of docs/performance.md.

Times are processor time, which other programs on the machine change little. The diagram's speed is
relative to the physics alone: the same plant with its contacts, motor gains and gravity
compensation. The runs alternate in one process, so the ratio holds on other machines too.
Rendering runs in its own processes: only its wall time counts.
"""

import argparse
import cProfile
import json
import os
import pstats
import sys
import time
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from test_control_step import TIME_STEP, make_controller

from pepper_drake.benchmarking.case import Case
from pepper_drake.benchmarking.physics_alone import make_physics
from pepper_drake.diagrams.reach_simulation import ReachSimulation, RunOptions
from pepper_drake.diagrams.reaching import Reaching
from pepper_drake.scenario import build_reaching

SPEED = Path(__file__).with_name("speed.json")

FIRST_SEED = 2000
"""First of the moving scenes whose planning times set `PlanningLatency`."""

PLANS = {"replan", "check_reach", "plan_retreat", "plan_return"}
DECISION = "a step that plans"
"""All answers of one step of supervision among which there is one of `PLANS`."""


def make_reaching(case: Case, *, cameras: bool) -> Reaching:
    """Returns the reaching diagram of a case."""
    scenario = case.scenario()
    scenario.station.cameras = cameras
    scenario.station.obstacle_motion_ports &= cameras
    return build_reaching(scenario)


def time_ticks(count: int = 2000) -> dict[str, Any]:
    """Prints and returns the durations of control ticks among 2,000 points."""
    simulator = make_controller()
    simulator.AdvanceTo(0.2)
    spent = []
    for _ in range(count):
        began = time.process_time()
        simulator.AdvanceTo(simulator.get_context().get_time() + TIME_STEP)
        spent.append(time.process_time() - began)
    return {"control tick": print_times("control tick", spent)}


def time_planner(scenes: int) -> dict[str, Any]:
    """Prints and returns the durations of planner calls in moving scenes, cameras on."""
    spent: dict[str, list[float]] = {}
    for seed in range(FIRST_SEED, FIRST_SEED + scenes):
        reaching = make_reaching(Case(seed, moving=True), cameras=True)
        report = ReachSimulation(reaching, RunOptions(progress=False)).run().report
        print(f"moving_{seed}: {report.outcome}", flush=True)
        steps = groupby(reaching.timed_planner.log, key=lambda answer: answer.time)
        for answers in (list(step) for _, step in steps):
            for answer in answers:
                spent.setdefault(answer.name, []).append(answer.seconds)
            if PLANS & {answer.name for answer in answers}:
                spent.setdefault(DECISION, []).append(sum(answer.seconds for answer in answers))
    times = {name: print_times(name, seconds) for name, seconds in spent.items()}
    return {"scenes": scenes, "answers": times}


def print_times(name: str, seconds: list[float]) -> dict[str, float]:
    """Prints and returns median, percentiles and maximum of durations [ms]."""
    p50, p90, p99, longest = 1e3 * np.percentile(seconds, [50, 90, 99, 100])
    print(
        f"{name:22s} {len(seconds):5d} x  median {p50:8.2f} ms  90 % {p90:8.2f}  "
        f"99 % {p99:8.2f}  longest {longest:8.2f}"
    )
    return {
        "count": len(seconds),
        "median_ms": round(p50, 3),
        "p90_ms": round(p90, 3),
        "p99_ms": round(p99, 3),
        "longest_ms": round(longest, 3),
    }


def simulators(case: Case) -> dict[str, Simulator]:
    """Returns simulators of the physics alone, and of the diagram without and with cameras."""
    loops = {on: make_reaching(case, cameras=on) for on in (False, True)}
    runs = {
        "physics alone": make_physics(case.build(), loops[False].station),
        "without cameras": Simulator(loops[False]),
        "with cameras": Simulator(loops[True]),
    }
    for simulator in runs.values():
        simulator.Initialize()
    renderer = loops[True].station.renderer
    assert renderer is not None
    renderer.wait_until_ready()
    return runs


def time_diagram(case: Case, until: float) -> dict[str, Any]:
    """Prints and returns the diagrams' speeds; they alternate every 0.5 s of simulated time."""
    runs = simulators(case)
    spent = {name: np.zeros(2) for name in runs}
    for end in np.arange(0.5, until + 0.25, 0.5):
        for name, simulator in runs.items():
            began = np.array([time.process_time(), time.perf_counter()])
            simulator.AdvanceTo(end)
            spent[name] += [time.process_time(), time.perf_counter()] - began
    found = {}
    for name, (processor, wall) in spent.items():
        ratio = spent["physics alone"] / spent[name]
        print(
            f"{name:16s} {until / processor:6.2f} x real time of a processor ({ratio[0]:.3f} of "
            f"physics alone), {until / wall:6.2f} x by the clock ({ratio[1]:.3f})"
        )
        found[name] = {
            "by_processor": round(until / processor, 3),
            "share_by_processor": round(ratio[0], 4),
            "by_clock": round(until / wall, 3),
            "share_by_clock": round(ratio[1], 4),
        }
    return {"scene": case.name, "until_s": until, "runs": found}


def profile_diagram(case: Case, until: float, cameras: bool) -> None:
    """Prints a profile of the whole diagram."""
    run = simulators(case)["with cameras" if cameras else "without cameras"]
    profiler = cProfile.Profile(time.process_time)
    profiler.runcall(run.AdvanceTo, until)
    pstats.Stats(profiler).sort_stats("tottime").print_stats(40).sort_stats(
        "cumulative"
    ).print_stats(80)


def main() -> int:
    """Runs the chosen benchmarks."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "what",
        nargs="+",
        choices=("tick", "planner", "diagram", "profile"),
        metavar="WHAT",
        help="tick, planner, diagram or profile; more than one may be given",
    )
    parser.add_argument("--scenes", type=int, default=8, help="moving scenes for the planner")
    parser.add_argument("--until", type=float, default=8.0, help="simulated time of a diagram [s]")
    parser.add_argument("--seed", type=int, default=0, help="of the diagram's random scene")
    parser.add_argument("--no-cameras", action="store_true", help="profile without cameras")
    parser.add_argument("--save", action="store_true", help="to benchmarks/speed.json")
    options = parser.parse_args()
    case = Case(options.seed)
    measure = {
        "tick": time_ticks,
        "planner": lambda: time_planner(options.scenes),
        "diagram": lambda: time_diagram(case, options.until),
        "profile": lambda: profile_diagram(case, options.until, not options.no_cameras),
    }
    saved = json.loads(SPEED.read_text()) if SPEED.exists() else {}
    for what in options.what:
        load = os.getloadavg()[0]
        figures = measure[what]()
        if options.save and figures is not None:
            saved[what] = {"processors": os.cpu_count(), "load_before": round(load, 2), **figures}
            SPEED.write_text(json.dumps(saved, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
