"""Learn a movement primitive from one or several demonstrations of the same motion.

Writes primitive.yaml, learn.png (the demonstration, what was learned, and how it is performed) and
report.json. A demonstration is a folder with translation.txt, a text file of ten columns, a
NAME_pose.txt, or what another tool recorded (see import.py): it is checked before it is learned.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np

from pepper_drake.cli import EXIT_DONE, make_parser, parse, run
from pepper_drake.cli_demonstration import add_import_options, import_options
from pepper_drake.errors import InputError
from pepper_drake.evaluation.approximator_comparison import distances
from pepper_drake.learning import (
    TORSO_HEIGHT,
    Demonstration,
    MovementPrimitive,
    approximator_names,
    fit_promp,
    fit_rhythmic,
)
from pepper_drake.learning.demonstrations.check import (
    examine,
    refuse_out_of_reach,
)
from pepper_drake.learning.demonstrations.demonstration_files import (
    read_demonstrations,
    read_joint_recording,
)
from pepper_drake.learning.demonstrations.refusals import refuse_far_place, refuse_unlike
from pepper_drake.learning.dmp.joint_primitive import JointPrimitive
from pepper_drake.learning.dmp.num_basis import DEFAULT_NUM_BASIS
from pepper_drake.learning.dmp.orientation import ORIENTATIONS
from pepper_drake.learning.dmp.primitive import (
    DEFAULT_APPROXIMATOR,
    DEFAULT_SCALING,
    FIT_TOLERANCE,
)
from pepper_drake.learning.dmp.scaling import SCALINGS
from pepper_drake.reporting.demonstration_figure import draw_demonstration
from pepper_drake.reporting.learning_figure import draw_learning
from pepper_drake.results.folder import whole_results
from pepper_drake.user_code import named_part


def parse_arguments() -> argparse.Namespace:
    """Returns the command line's arguments."""
    parser = make_parser("learn", __doc__)
    add = parser.add_argument
    add("demonstrations", nargs="+", type=Path, metavar="DEMO", help="a demonstration")
    add(
        "--approximator",
        default=DEFAULT_APPROXIMATOR,
        metavar="NAME",
        help=f"one of {', '.join(approximator_names())}, or FILE.py:NAME of your own"
        " (default: %(default)s)",
    )
    add(
        "--num-basis",
        type=int,
        metavar="N",
        help=f"number of basis functions (default: {DEFAULT_NUM_BASIS}, or as the data ask for)",
    )
    add(
        "--scaling",
        default=DEFAULT_SCALING,
        metavar="NAME",
        help=f"adaptation to start and goal: {', '.join(SCALINGS)} (default: %(default)s)",
    )
    add(
        "--orientation",
        default=ORIENTATIONS[0],
        metavar="NAME",
        help=f"how it is learned: {', '.join(ORIENTATIONS)} (default: %(default)s)",
    )
    add("--mirror", action="store_true", help="learn it for the other arm (y becomes -y)")
    add("--trim", action="store_true", help="leave out the rest at both ends")
    add("--smooth", type=float, metavar="HZ", help="smooth with this cut-off frequency")
    add(
        "--from-floor",
        action="store_true",
        help=f"positions are above the floor: the torso frame is {TORSO_HEIGHT} m higher",
    )
    add("--rhythmic", action="store_true", help="learn a periodic motion: rhythmic.yaml")
    add(
        "--period", type=float, metavar="S", help="period of a periodic motion (default: estimated)"
    )
    add(
        "--joints",
        action="store_true",
        help="learn the joints, not the hand: joints.yaml; any number of Pepper's joints",
    )
    add(
        "--via",
        type=float,
        nargs=4,
        action="append",
        default=[],
        metavar=("SHARE", "X", "Y", "Z"),
        help="learn the distribution of several demonstrations (ProMP), and the motion of it that"
        " passes a point [m] after a share of its time",
    )
    add_import_options(parser)
    return parse(parser)


def prepare(demonstration: Demonstration, arguments: argparse.Namespace) -> Demonstration:
    """Smooths, trims and mirrors the demonstration by the options."""
    if arguments.smooth is not None:
        if not arguments.smooth > 0.0:
            raise InputError(f"--smooth: {arguments.smooth} Hz is not positive")
        demonstration = demonstration.smoothed(arguments.smooth)
    if arguments.trim:
        demonstration = demonstration.trimmed()
    return demonstration.mirrored() if arguments.mirror else demonstration


def learn_rhythmic(demonstration: Demonstration, arguments: argparse.Namespace) -> int:
    """Learns a periodic motion, writes it, and returns the exit code."""
    number = 25 if arguments.num_basis is None else arguments.num_basis
    primitive = fit_rhythmic(demonstration, period=arguments.period, num_basis=number)
    turns = (demonstration.times - demonstration.times[0]) / primitive.period
    positions = primitive.limit_cycle(2.0 * np.pi * turns)[0]
    error = float(np.linalg.norm(positions - demonstration.positions, axis=1).mean())
    report = {
        "period": primitive.period,
        "num_basis": number,
        "orientation": primitive.rotation_weights is not None,
        "position_distance": error,
        "checks": [examine(demonstration).to_data()],
    }
    path = primitive.rollout(3.0 * primitive.period)
    name = f"{demonstration.name}, three periods"
    cycle = Demonstration.from_positions(path.times, path.positions, path.velocities, name=name)
    figure = draw_demonstration(cycle, examine(cycle))
    with whole_results(arguments.output, ("rhythmic.yaml", "learn.png", "report.json")) as folder:
        primitive.save(folder / "rhythmic.yaml")
        figure.savefig(folder / "learn.png", dpi=110)
        (folder / "report.json").write_text(json.dumps(report, indent=2) + "\n")
    if not arguments.quiet:
        print(
            f"{demonstration.name}: a period of {primitive.period:.3f} s, reproduced to"
            f" {1000 * error:.2g} mm; wrote rhythmic.yaml and learn.png to {arguments.output}"
        )
    return EXIT_DONE


def learn_joints(arguments: argparse.Namespace) -> int:
    """Learns the joints of one recording, writes them, and returns the exit code."""
    (file,) = one(arguments.demonstrations, "--joints")
    recording = read_joint_recording(file, import_options(arguments))
    primitive = JointPrimitive.fit(
        recording.times,
        recording.joints,
        recording.names,
        approximator=arguments.approximator,
        num_basis=arguments.num_basis,
        scaling=arguments.scaling,
        seed=arguments.seed,
        name=recording.name,
    )
    path = primitive.rollout()
    times = recording.times - recording.times[0]
    reproduced = [np.interp(times, path.times, column) for column in path.joints.T]
    error = float(np.abs(np.column_stack(reproduced) - recording.joints).max())
    report = {"joints": list(primitive.names), "joint_distance": error, "notes": recording.notes}
    with whole_results(arguments.output, ("joints.yaml", "report.json")) as folder:
        primitive.save(folder / "joints.yaml")
        (folder / "report.json").write_text(json.dumps(report, indent=2) + "\n")
    if not arguments.quiet:
        print(
            f"{recording.name}: {len(primitive.names)} joints, reproduced to {error:.2g} rad; wrote"
            f" joints.yaml to {arguments.output}"
        )
    return EXIT_DONE


def one(files: list[Path], option: str) -> list[Path]:
    """Returns the only file.

    Raises:
        InputError: There are several.
    """
    if len(files) != 1:
        raise InputError(f"{option} learns from one demonstration, not from {len(files)}")
    return files


def conditioned(demonstrations: list[Demonstration], via: list[list[float]]) -> Demonstration:
    """Returns the mean of the ProMP of demonstrations, conditioned on via points.

    Raises:
        InputError: There are too few demonstrations, or a via point is invalid.
    """
    for share, *point in via:
        if not (0.0 <= share <= 1.0 and np.isfinite(point).all()):
            raise InputError(f"--via {share:g}: a share of the time from 0 to 1, and x y z")
        refuse_far_place(point, "--via")
    refuse_unlike(demonstrations)
    promp = fit_promp(demonstrations)
    for share, *point in via:
        promp = promp.condition(share * promp.duration, point)
    motion = promp.demonstration()
    refuse_out_of_reach(motion, "--via")
    return motion


def main() -> int:
    """Runs the app and returns its exit code."""
    arguments = parse_arguments()
    arguments.approximator = named_part(arguments.approximator)
    if arguments.from_floor:
        arguments.frame = "base_footprint"
    if arguments.joints:
        return learn_joints(arguments)
    options = import_options(arguments)
    loaded = [
        demo for path in arguments.demonstrations for demo in read_demonstrations(path, options)
    ]
    checks = [examine(demo) for demo in loaded]
    demonstrations = [prepare(demo, arguments) for demo in loaded]
    if arguments.rhythmic:
        one(arguments.demonstrations, "--rhythmic")
        return learn_rhythmic(demonstrations[0], arguments)
    if arguments.via:
        demonstrations = [conditioned(demonstrations, arguments.via)]
    started = time.perf_counter()
    primitive = MovementPrimitive.fit(
        demonstrations,
        approximator=arguments.approximator,
        num_basis=arguments.num_basis,
        scaling=arguments.scaling,
        orientation=arguments.orientation,
        seed=arguments.seed,
    )
    fit_seconds = time.perf_counter() - started

    rows: list[dict[str, Any]] = []
    for demo in demonstrations:
        reproduced = primitive.rollout(
            start=demo.positions[0],
            goal=demo.positions[-1],
            duration=demo.duration,
            start_velocity=demo.velocities[0],
        )
        position, velocity = distances(demo, reproduced)
        largest = primitive.distance(demo)
        rows.append(
            {
                "demonstration": demo.name,
                "samples": len(demo.times),
                "duration": demo.duration,
                "derivatives": demo.derivation,
                "position_distance": position,
                "velocity_distance": velocity,
                "largest_position_distance": largest,
            }
        )
    report = {
        "approximator": primitive.approximator,
        "num_basis": primitive.num_basis,
        "scaling": primitive.translation.scaling,
        "orientation": primitive.orientation.mode if primitive.orientation else None,
        "joints": list(primitive.posture.names) if primitive.posture else [],
        "fit_seconds": fit_seconds,
        "demonstrations": rows,
        "checks": [check.to_data() for check in checks],
    }
    figure = draw_learning(primitive, demonstrations, primitive.rollout())
    names = ("primitive.yaml", "learn.png", "report.json")
    with whole_results(arguments.output, names) as folder:
        primitive.save(folder / "primitive.yaml")
        (folder / "report.json").write_text(json.dumps(report, indent=2) + "\n")
        figure.savefig(folder / "learn.png", dpi=110)

    if not arguments.quiet:
        for check in checks:
            print("\n".join(check.lines()))
        for row in rows:
            print(
                f"{row['demonstration']}: {row['samples']} samples, {row['duration']:.2f} s,"
                f" velocities and accelerations {row['derivatives']}"
            )
            print(
                f"  reproduced to {row['position_distance']:.2g} m and"
                f" {row['velocity_distance']:.2g} m/s (equation 4.1)"
            )
            if row["largest_position_distance"] > FIT_TOLERANCE:
                print(
                    f"  warning: the motion leaves it by {row['largest_position_distance']:.2g} m"
                    " at most; learn a shorter part, or with more basis functions (--num-basis)"
                )
        parts = ["translation"]
        parts += ["orientation"] if primitive.orientation else []
        parts += ["joints"] if primitive.posture else []
        print(
            f"learned {', '.join(parts)} with {primitive.approximator},"
            f" {primitive.num_basis} basis functions, in {1000 * fit_seconds:.1f} ms"
        )
        print(f"wrote primitive.yaml, learn.png and report.json to {arguments.output}")
    return EXIT_DONE


if __name__ == "__main__":
    run(main)
