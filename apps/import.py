"""Turn recordings of other tools into demonstrations, and check them.

Reads tables (CSV, TSV, text) by the names of their columns, TUM, EuRoC, rostopic echo -p, OptiTrack
Motive and Vicon exports, LASA .mat, dmpbbo trajectories, Choregraphe timelines, joint logs of
ALMotion, ROS bags and MCAP, LeRobot datasets. For each motion DIR/NAME gets translation.txt,
rotation.txt and joints.csv where known, check.png and check.json: rate, gaps, noise, speed, reach
and what is doubtful.

  import.py take.csv                              named columns, units in the names or the header
  import.py log.csv --unit mm --time ms           what the file does not say
  import.py angles.csv --angle deg --arm right    joints alone: the hand by forward kinematics
  import.py path.txt --plane 0.2 -0.2 0 0 0 0     a path of two dimensions on a table's top
"""

import json
import re
from pathlib import Path

from pepper_drake.cli import EXIT_DONE, make_parser, parse, run
from pepper_drake.cli_demonstration import add_import_options, import_options
from pepper_drake.learning.demonstrations.check import examine
from pepper_drake.learning.demonstrations.demonstration_files import (
    JOINTS,
    ROTATION,
    TRANSLATION,
    read_demonstrations,
)
from pepper_drake.reporting.demonstration_figure import draw_demonstration
from pepper_drake.results.folder import whole_results

_RESULTS = (TRANSLATION, ROTATION, JOINTS, "check.json", "check.png")


def main() -> int:
    """Runs the app and returns its exit code."""
    parser = make_parser("import", __doc__)
    parser.add_argument("files", nargs="+", type=Path, metavar="FILE", help="what was recorded")
    add_import_options(parser)
    arguments = parse(parser)
    options = import_options(arguments)
    motions = [motion for file in arguments.files for motion in read_demonstrations(file, options)]
    taken: set[str] = set()
    for motion in motions:
        folder = arguments.output / free_name(motion.name, taken)
        report = examine(motion)
        with whole_results(folder, _RESULTS) as inside:
            motion.save(inside)
            (inside / "check.json").write_text(json.dumps(report.to_data(), indent=2) + "\n")
            draw_demonstration(motion, report).savefig(inside / "check.png", dpi=100)
        if not arguments.quiet:
            print("\n".join(report.lines()))
            print(f"{report.name}: wrote {folder}")
    return EXIT_DONE


def free_name(name: str, taken: set[str]) -> str:
    """Returns an unused folder name without special characters."""
    clean = re.sub(r"[^\w.-]+", "_", name).strip("._")[:80] or "motion"
    number, free = 1, clean
    while free in taken:
        number += 1
        free = f"{clean}_{number}"
    taken.add(free)
    return free


if __name__ == "__main__":
    run(main)
