"""Record a demonstration: a scripted guide leads the limp arm by the hand, in simulation.

Writes a folder with translation.txt, rotation.txt and joints.csv (the demonstration), report.json
and recording.html (a stand-alone page that shows the motion).
"""

import json
import logging
import time

import numpy as np
from pydrake.geometry import Meshcat

from pepper_drake.cli import EXIT_DONE, EXIT_FAILED, make_parser, run
from pepper_drake.diagrams.teaching import record_guided
from pepper_drake.models.guide import GUIDES, load_guide

MAX_FINAL_DISTANCE = 0.02
"""Farther from the guide [m] than this at the end, the hand did not follow it."""


def main() -> int:
    """Runs the app and returns its exit code."""
    parser = make_parser("record", __doc__)
    parser.add_argument(
        "--guide",
        default="reach",
        metavar="NAME|FILE",
        help=f"guide script: {', '.join(GUIDES)} or a YAML file (default: %(default)s)",
    )
    parser.add_argument(
        "--arm", choices=("left", "right"), help="mirror the script for this arm if need be"
    )
    arguments = parser.parse_args()
    script = load_guide(arguments.guide)
    if arguments.arm not in (None, script.arm):
        script = script.mirrored()

    logging.getLogger("drake").setLevel(logging.WARNING)  # Not where meshcat could be watched.
    meshcat = Meshcat()
    start = time.perf_counter()
    recording = record_guided(script, meshcat)
    wall_seconds = time.perf_counter() - start
    demonstration = recording.demonstration

    followed = recording.final_distance <= MAX_FINAL_DISTANCE
    report = {
        "outcome": "recorded" if followed else "failed",
        "reason": "" if followed else "the hand did not follow the guide to its last via point",
        "arm": script.arm,
        "samples": len(demonstration.times),
        "duration": demonstration.duration,
        "path_length": demonstration.path_length,
        "max_speed": float(np.linalg.norm(demonstration.velocities, axis=1).max()),
        "guide_distance_rms": recording.guide_distance_rms,
        "final_guide_distance": recording.final_distance,
        "wall_seconds": wall_seconds,
        "seed": arguments.seed,
    }
    arguments.output.mkdir(parents=True, exist_ok=True)
    demonstration.save(arguments.output)
    (arguments.output / "report.json").write_text(json.dumps(report, indent=2) + "\n")
    (arguments.output / "recording.html").write_text(meshcat.StaticHtml())
    if not arguments.quiet:
        print(
            f"{report['outcome']}: {report['samples']} samples, {report['duration']:.2f} s, "
            f"{report['path_length']:.2f} m of the {script.arm} hand in {arguments.output}"
        )
    return EXIT_DONE if followed else EXIT_FAILED


if __name__ == "__main__":
    run(main)
