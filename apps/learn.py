"""Learn a movement primitive from one or several demonstrations of the same motion.

Writes primitive.yaml, learn.png (what was shown, what was learned and how it is performed) and
report.json. A demonstration is a folder with translation.txt, a text file of ten columns, or a
NAME_pose.txt.
"""

import argparse
import json
import time

from pepper_drake.cli import EXIT_DONE, make_parser, run
from pepper_drake.errors import InputError
from pepper_drake.evaluation.approximator_comparison import distances
from pepper_drake.learning import (
    TORSO_HEIGHT,
    Demonstration,
    MovementPrimitive,
    approximator_names,
)
from pepper_drake.learning.dmp.orientation import ORIENTATIONS
from pepper_drake.learning.dmp.primitive import (
    DEFAULT_APPROXIMATOR,
    DEFAULT_NUM_BASIS,
    DEFAULT_SCALING,
)
from pepper_drake.learning.dmp.scaling import SCALINGS
from pepper_drake.reporting.learning_figure import draw_learning
from pepper_drake.results.folder import whole_results


def parse_arguments() -> argparse.Namespace:
    """Returns the command line's arguments."""
    parser = make_parser("learn", __doc__)
    add = parser.add_argument
    add("demonstrations", nargs="+", metavar="DEMO", help="a demonstration")
    add(
        "--approximator",
        default=DEFAULT_APPROXIMATOR,
        metavar="NAME",
        help=f"one of {', '.join(approximator_names())} (default: %(default)s)",
    )
    add(
        "--num-basis",
        type=int,
        default=DEFAULT_NUM_BASIS,
        metavar="N",
        help="number of basis functions (default: %(default)s)",
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
    return parser.parse_args()


def prepare(demonstration: Demonstration, arguments: argparse.Namespace) -> Demonstration:
    """Returns the demonstration as the options want it."""
    if arguments.smooth is not None:
        if not arguments.smooth > 0.0:
            raise InputError(f"--smooth: {arguments.smooth} Hz is not positive")
        demonstration = demonstration.smoothed(arguments.smooth)
    if arguments.trim:
        demonstration = demonstration.trimmed()
    if arguments.from_floor:
        demonstration = demonstration.translated((0.0, 0.0, -TORSO_HEIGHT))
    return demonstration.mirrored() if arguments.mirror else demonstration


def main() -> int:
    """Runs the app and returns its exit code."""
    arguments = parse_arguments()
    demonstrations = [
        prepare(Demonstration.load(path), arguments) for path in arguments.demonstrations
    ]
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

    rows = []
    for demo in demonstrations:
        own = primitive.rollout(
            start=demo.positions[0],
            goal=demo.positions[-1],
            duration=demo.duration,
            start_velocity=demo.velocities[0],
        )
        position, velocity = distances(demo, own)
        rows.append(
            {
                "demonstration": demo.name,
                "samples": len(demo.times),
                "duration": demo.duration,
                "derivatives": demo.derivation,
                "position_distance": position,
                "velocity_distance": velocity,
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
    }
    figure = draw_learning(primitive, demonstrations, primitive.rollout())
    names = ("primitive.yaml", "learn.png", "report.json")
    with whole_results(arguments.output, names) as folder:
        primitive.save(folder / "primitive.yaml")
        (folder / "report.json").write_text(json.dumps(report, indent=2) + "\n")
        figure.savefig(folder / "learn.png", dpi=110)

    if not arguments.quiet:
        for row in rows:
            print(
                f"{row['demonstration']}: {row['samples']} samples, {row['duration']:.2f} s,"
                f" velocities and accelerations {row['derivatives']}"
            )
            print(
                f"  given back to {row['position_distance']:.2g} m and"
                f" {row['velocity_distance']:.2g} m/s (equation 4.1)"
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
