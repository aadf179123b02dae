"""Record a demonstration, in simulation or on a robot, in one of the ways to teach an arm.

  --way guided    a person leads the limp arm by the hand, along a script of via points
  --way joints    a person drags the arm's joints, one after the other
  --way gamepad   a person steers the hand with a game pad's sticks and buttons
  --way marker    a person opposite the robot moves a marker; a camera of the head sees it, and
                  the arm does the same, scaled to its own size

Writes a folder with translation.txt, rotation.txt and joints.csv (the demonstration), report.json
and recording.html (a stand-alone page that shows the motion). What is recorded is on the disk
within a second. Ctrl-C ends the recording and keeps it; after a crash the folder can be used as it
is, and --recover makes it a finished demonstration. Exit code 0: recorded; 1: the hand did not
follow the script; 130: ended before the hand moved, nothing is kept.

  record.py --guide reach                     the script that ships
  record.py --guide my_guide.yaml --arm left  a script of your own, mirrored for the left arm
  record.py --way joints                      as it ships; --guide FILE for your own
  record.py --way marker --guide mine.yaml    its fields scale and yaw say how the person's
                                              motion becomes the arm's
  record.py --recover out/record              keep what an interrupted recording left
  record.py --station naoqi --robot tcp://192.168.1.10:9559 --arm right
      a real Pepper, or a served one: its arm goes limp, and you lead it by the hand until you
      press the chest button, touch the head or the other hand's back, or Ctrl-C
"""

import argparse
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from pepper_drake.cli import (
    EXIT_DONE,
    EXIT_FAILED,
    add_host_option,
    make_parser,
    parse,
    quiet_libraries,
    run,
    shows_progress,
    stop_on_interrupt,
)
from pepper_drake.diagrams.marker_teaching import record_marker
from pepper_drake.diagrams.recording import (
    Recording,
    RecordOptions,
    record_guided,
    record_joints,
    record_pad,
)
from pepper_drake.hardware.options import (
    add_link_options,
    add_robot_address,
    check_station,
    robot_access,
)
from pepper_drake.hardware.robot_recording import RobotRecordOptions, record_robot
from pepper_drake.learning import Demonstration
from pepper_drake.learning.demonstrations.recording import recover
from pepper_drake.models.guide import GUIDES, load_guide
from pepper_drake.models.joint_script import JOINT_SCRIPTS, load_joint_script
from pepper_drake.models.marker_script import MARKER_SCRIPTS, load_marker_script
from pepper_drake.models.pad_script import PAD_SCRIPTS, load_pad_script
from pepper_drake.results.folder import whole_results
from pepper_drake.web.announcement import wait_for_browser
from pepper_drake.web.drake_page import open_meshcat

MAX_FINAL_DISTANCE = 0.02
"""Largest final distance of a hand that followed the script [m]."""
SHIPPED = {
    "guided": GUIDES,
    "joints": JOINT_SCRIPTS,
    "gamepad": PAD_SCRIPTS,
    "marker": MARKER_SCRIPTS,
}
"""Shipped scripts by teaching method; the first is the default."""

WAYS: dict[str, tuple[Callable[..., Any], Callable[..., Any]]] = {
    "guided": (load_guide, record_guided),
    "joints": (load_joint_script, record_joints),
    "gamepad": (load_pad_script, record_pad),
    "marker": (load_marker_script, record_marker),
}
"""Loader of a script and recorder of its movement, by teaching method."""
SIMULATED_ONLY: dict[str, object] = {
    "way": "guided",
    "guide": None,
    "live": False,
    "recover": None,
}
"""Options for the simulation only, and their defaults."""


def main() -> int:
    """Runs the app and returns its exit code."""
    parser = make_parser("record", __doc__)
    parser.add_argument(
        "--way",
        choices=tuple(SHIPPED),
        default="guided",
        help="how the movement is taught (default: %(default)s)",
    )
    names = "; ".join(f"{way}: {', '.join(shipped)}" for way, shipped in SHIPPED.items())
    parser.add_argument(
        "--guide",
        metavar="NAME|FILE",
        help=f"script: one that ships ({names}) or a YAML file (default: the first of its --way)",
    )
    parser.add_argument(
        "--arm", choices=("left", "right"), help="mirror the script for this arm if need be"
    )
    parser.add_argument(
        "--live", action="store_true", help="show it in a browser while it is recorded"
    )
    add_host_option(parser)
    parser.add_argument(
        "--recover",
        type=Path,
        metavar="DIR",
        help="finish the recording that was interrupted in this folder, and do nothing else",
    )
    add_robot_address(parser)
    add_link_options(parser, moves=False)
    arguments = parse(parser)
    is_robot = check_station(arguments, SIMULATED_ONLY)
    if is_robot:
        return record_on_robot(arguments)
    if arguments.recover is not None:
        return keep(arguments.recover, quiet=arguments.quiet)
    return record(arguments)


def record_on_robot(arguments: argparse.Namespace) -> int:
    """Records a person who leads the limp arm of a robot."""
    quiet_libraries()
    access = robot_access(arguments)
    arm = arguments.arm or "right"
    with stop_on_interrupt() as should_stop:
        recording = record_robot(
            access,
            RobotRecordOptions(
                arguments.output,
                arm,
                arguments.disable_life,
                should_stop,
                lambda line: None if arguments.quiet else print(line, flush=True),
                arguments.clock_rate,
            ),
        )
    demonstration = recording.demonstration
    report = {
        "outcome": "recorded",
        "reason": "",
        "way": "robot",
        "address": access.address,
        "ended_by": recording.ended_by or "user",
        "arm": arm,
        "samples": recording.samples,
        "duration": demonstration.duration,
        "path_length": demonstration.path_length,
    }
    with whole_results(arguments.output, ("report.json",)) as folder:
        (folder / "report.json").write_text(json.dumps(report, indent=2) + "\n")
    if not arguments.quiet:
        print(f"recorded: {summary(demonstration)} of the {arm} hand in {arguments.output}")
    return EXIT_DONE


def keep(folder: Path, *, quiet: bool) -> int:
    """Recovers a demonstration from an interrupted recording."""
    demonstration = recover(folder)
    if not quiet:
        print(f"recovered: {summary(demonstration)} in {folder}")
    return EXIT_DONE


def record(arguments: argparse.Namespace) -> int:
    """Records a script and reports the outcome."""
    quiet_libraries()
    start = time.perf_counter()
    with open_meshcat(page=arguments.live, host=arguments.host) as (meshcat, shown):
        if shown is not None:
            wait_for_browser(shown)
        with stop_on_interrupt() as should_stop:
            options = RecordOptions(
                folder=arguments.output,
                should_stop=should_stop,
                meshcat=meshcat,
                realtime=arguments.live,
                progress=shows_progress(arguments),
            )
            arm, recording, seen = perform(arguments, options)
        page = meshcat.StaticHtml()
    wall_seconds = time.perf_counter() - start
    demonstration = recording.demonstration

    followed = recording.final_distance <= MAX_FINAL_DISTANCE or recording.stopped
    report = {
        "outcome": "recorded" if followed else "failed",
        "reason": "" if followed else "the hand did not follow the script to its end",
        "stopped_by_user": recording.stopped,
        "way": arguments.way,
        "arm": arm,
        "samples": len(demonstration.times),
        "duration": demonstration.duration,
        "path_length": demonstration.path_length,
        "max_speed": float(np.linalg.norm(demonstration.velocities, axis=1).max()),
        "derivation": demonstration.derivation,
        "guide_distance_rms": recording.distance_rms,
        "final_guide_distance": recording.final_distance,
        **seen,
        "wall_seconds": wall_seconds,
        "seed": arguments.seed,
    }
    with whole_results(arguments.output, ("report.json", "recording.html")) as folder:
        (folder / "report.json").write_text(json.dumps(report, indent=2) + "\n")
        (folder / "recording.html").write_text(page)
    if not arguments.quiet:
        ending = "stopped" if recording.stopped else report["outcome"]
        print(f"{ending}: {summary(demonstration)} of the {arm} hand in {arguments.output}")
    return EXIT_DONE if followed else EXIT_FAILED


def perform(
    arguments: argparse.Namespace, options: RecordOptions
) -> tuple[str, Recording, dict[str, float]]:
    """Records the script of a teaching method; returns arm, recording and tracking statistics."""
    load, record_by = WAYS[arguments.way]
    script = load(arguments.guide or SHIPPED[arguments.way][0])
    if arguments.arm not in (None, script.arm):
        script = script.mirrored()
    if arguments.way != "marker":
        return script.arm, record_by(script, options), {}
    result = record_marker(script, options, seed=arguments.seed)
    seen = {
        "sightings": len(result.sightings.times),
        "sighting_error_rms": result.tracking_error_rms,
    }
    return script.arm, result.recording, seen


def summary(demonstration: Demonstration) -> str:
    """Returns a short summary of a recording."""
    return (
        f"{len(demonstration.times)} samples, {demonstration.duration:.2f} s, "
        f"{demonstration.path_length:.2f} m"
    )


if __name__ == "__main__":
    run(main)
