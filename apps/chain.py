"""Perform taught movements in sequence, each from where the last one ended, without a jump.

A MOVEMENT is a demonstration or a primitive's YAML file, of the right arm; with @X,Y,Z it ends
there [m, torso frame], with ! it ends without a stop; wait:S waits S seconds. Writes chain/ (the
whole motion as a demonstration, which learn.py, reproduce.py and play.py take), chain.png and
report.json with the jumps of the velocity at the joins.

  chain.py reach.yaml wait:1 lift.yaml put_down.yaml return.yaml
  chain.py reach.yaml! lift.yaml@0.2,-0.2,0.1 --via 1 0.5 0.15 -0.3 0    over a point, halfway
  chain.py reach.yaml lift.yaml --move 2 1.5 0.2 -0.25 0.15   the second goal moves after 1.5 s
  chain.py reach.yaml lift.yaml --perform                     by the simulated arm
"""

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from pepper_drake.cli import (
    EXIT_DONE,
    EXIT_FAILED,
    make_parser,
    parse,
    quiet_libraries,
    run,
    shows_progress,
)
from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.demonstrations.check import examine
from pepper_drake.learning.demonstrations.refusals import refuse_far_place
from pepper_drake.learning.dmp.chain import BLEND, Chain, Step, plan_chain
from pepper_drake.results.folder import whole_results

REACHED = 0.01
"""Largest distance of the hand from a reached goal [m]."""


def main() -> int:
    """Runs the app and returns its exit code."""
    arguments = parse_arguments()
    steps = read_steps(arguments.movements, relative=arguments.relative)
    for number, share, *point in arguments.via:
        k = index_of(number, steps, "--via")
        if steps[k].primitive is None:
            raise InputError(f"--via {number:g}: movement {number:g} waits")
        refuse_far_place(point, "--via")
        via = tuple(sorted((*steps[k].via, (share, point)), key=lambda entry: entry[0]))
        steps[k] = Step(**{**vars(steps[k]), "via": via})
    if arguments.start is not None:
        refuse_far_place(arguments.start, "--start")
    begun = time.perf_counter()
    chain = plan_chain(
        steps, start=arguments.start, time_step=arguments.time_step, blend=arguments.blend
    )
    seconds = time.perf_counter() - begun
    replans = []
    for number, moment, *goal in arguments.move:
        refuse_far_place(goal, "--move")
        begun = time.perf_counter()
        chain = chain.replanned(moment, index_of(number, steps, "--move"), goal)
        replans.append(time.perf_counter() - begun)
    motion = chain.demonstration()
    report = {
        "outcome": "planned",
        "reason": "",
        "movements": list(arguments.movements),
        "joins": chain.joins.tolist(),
        "duration": motion.duration,
        "largest_velocity_jump": chain.largest_jump,
        "top_speed": float(np.linalg.norm(motion.velocities, axis=1).max()),
        "within_reach": examine(motion).within_reach,
        "planning_seconds": seconds,
        "replanning_seconds": replans,
        "seed": arguments.seed,
    }
    with whole_results(arguments.output, ("chain", "chain.png", "report.json")) as folder:
        motion.save(folder / "chain")
        if arguments.perform:
            perform(arguments, report, folder / "chain")
        draw(chain, motion).savefig(folder / "chain.png", dpi=110)
        (folder / "report.json").write_text(json.dumps(report, indent=2) + "\n")
    if not arguments.quiet:
        print(
            f"{len(steps)} movements, {motion.duration:.2f} s, at most {report['top_speed']:.2f}"
            f" m/s; jump of the velocity at the joins {1000 * chain.largest_jump:.2g} mm/s,"
            f" {100 * examine(motion).within_reach:.0f} % within the arm's reach"
        )
        print(f"{report['outcome']}; wrote chain/, chain.png and report.json to {arguments.output}")
    return EXIT_FAILED if report["outcome"] == "failed" else EXIT_DONE


def parse_arguments() -> argparse.Namespace:
    """Reads the command line."""
    parser = make_parser("chain", __doc__)
    add = parser.add_argument
    add("movements", nargs="+", metavar="MOVEMENT", help="FILE, FILE@X,Y,Z, FILE! or wait:S")
    add("--relative", action="store_true", help="goals are the demonstrations' displacements")
    add("--start", type=float, nargs=3, metavar=("X", "Y", "Z"), help="where the hand is [m]")
    add(
        "--via",
        type=float,
        nargs=5,
        action="append",
        default=[],
        metavar=("N", "SHARE", "X", "Y", "Z"),
        help="movement N passes a point [m] after a share of its time",
    )
    add(
        "--move",
        type=float,
        nargs=5,
        action="append",
        default=[],
        metavar=("N", "S", "X", "Y", "Z"),
        help="the goal of movement N moves to a point [m] when S seconds have passed",
    )
    add("--time-step", type=float, default=0.01, metavar="S", help="default: %(default)s s")
    add(
        "--blend",
        type=float,
        default=BLEND,
        metavar="S",
        help="time over which velocities are blended at the joins (default: %(default)s s)",
    )
    add("--perform", action="store_true", help="perform it by the simulated arm, without cameras")
    add("--arm", choices=("left", "right"), default="right", help="default: %(default)s")
    return parse(parser)


def read_steps(words: Sequence[str], *, relative: bool) -> list[Step]:
    """Reads the movements of the command line.

    Raises:
        InputError: A movement cannot be read.
    """
    steps = []
    for word in words:
        if word.startswith("wait:"):
            steps.append(Step(None, duration=number(word.removeprefix("wait:"), word)))
            continue
        name, stop = word.removesuffix("!"), not word.endswith("!")
        goal = None
        if not Path(name).exists() and "@" in name:
            name, _, place = name.rpartition("@")
            goal = [number(part, word) for part in place.split(",")]
            if len(goal) == 3:
                refuse_far_place(goal, word)
        path = Path(name)
        if path.suffix in (".yaml", ".yml"):
            primitive = MovementPrimitive.load(path)
        else:
            primitive = MovementPrimitive.fit(Demonstration.load(path))
        steps.append(Step(primitive, goal=goal, relative=relative, stop=stop))
    return steps


def number(text: str, word: str) -> float:
    """Parses a finite number in a movement's argument `word`."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not np.isfinite(value):
        raise InputError(f"{word}: '{text}' is not a number; write FILE@X,Y,Z or wait:SECONDS")
    return value


def index_of(number: float, steps: Sequence[Step], option: str) -> int:
    """Returns the index of a movement from its one-based number."""
    if number not in range(1, len(steps) + 1):
        raise InputError(f"{option} {number:g}: there are {len(steps)} movements, from 1")
    return int(number) - 1


def draw(chain: Chain, motion: Demonstration) -> Figure:
    """Plots positions and speed over time, with the joins."""
    figure = Figure(figsize=(10, 7), layout="constrained")
    figure.suptitle("Does the hand pass from each movement to the next without a jump?")
    places, speeds = figure.subplots(2, 1, sharex=True)
    for axis, column, color in zip(
        "xyz", motion.positions.T, ("tab:red", "tab:green", "tab:blue"), strict=True
    ):
        places.plot(motion.times, column, color=color, label=axis)
    speeds.plot(motion.times, np.linalg.norm(motion.velocities, axis=1), color="tab:purple")
    for axes in (places, speeds):
        for number, join in enumerate(chain.joins[:-1]):
            label = "join" if number == 0 else ""
            axes.axvline(join, color="black", linestyle=":", label=label)
        axes.grid(alpha=0.3)
    places.set(ylabel="position in the torso frame [m]")
    places.legend()
    speeds.set(xlabel="time [s]", ylabel="speed [m/s]")
    return figure


def perform(arguments: argparse.Namespace, report: dict[str, object], chain: Path) -> None:
    """Performs the motion in simulation and adds the outcome to the report."""
    from pepper_drake.diagrams.factory import make_primitive
    from pepper_drake.diagrams.reproduction_simulation import ReproductionOptions, reproduce

    quiet_libraries()
    primitive = make_primitive(chain, arguments.arm)
    result = reproduce(
        primitive, arguments.arm, ReproductionOptions(progress=shows_progress(arguments))
    )
    assert result is not None  # Only a stop request returns None.
    failed = result.final_position_error > REACHED
    report.update(
        outcome="failed" if failed else "reached",
        reason="not_reached" if failed else "",
        final_position_error=result.final_position_error,
        worst_joint_speed=result.worst_joint_speed,
        simulated_seconds=float(result.motion.times[-1]),
    )


if __name__ == "__main__":
    run(main)
