"""Perform a movement without cameras, by a soft arm; push it on its way, correct it, rate it.

The arm gives way when it is pushed, and the movement waits for it. Writes report.json, log.npz and
recording.html; with --learn-corrections also corrected.yaml, a primitive that goes where the hand
was pushed, and with --score a line in a file of scores, which `optimize.py` takes as its cost.

  reproduce.py                                        the movement that ships
  reproduce.py --demo my_motion/ --arm left           one of your own
  reproduce.py --push 0 0 5 --push-at 1.5             5 N upward, from 1.5 s on, for half a second
  reproduce.py --push 0 -5 0 --learn-corrections      a new primitive, bent to where it was pushed
  reproduce.py --set compliance.tracking.rate=10      other numbers of arm and controller
  reproduce.py --primitive out/reproduce/corrected.yaml --score 8 --scores scores.txt
  reproduce.py --station naoqi --robot tcp://192.168.1.10:9559     a real Pepper, or a served one
"""

import argparse
import json
import shutil
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from pepper_drake import cli
from pepper_drake.cli import (
    EXIT_DONE,
    EXIT_FAILED,
    EXIT_INTERRUPTED,
    add_host_option,
    make_parser,
    quiet_libraries,
    run,
    shows_progress,
    stop_on_interrupt,
)
from pepper_drake.cli_scenario import add_scenario_options, check_robot_takes, scenario_of
from pepper_drake.diagrams.compliance import ComplianceConfig
from pepper_drake.diagrams.factory import LearningParams, make_primitive
from pepper_drake.diagrams.reproduction import ReproductionParams
from pepper_drake.diagrams.reproduction_simulation import (
    ReproductionOptions,
    ReproductionResult,
    reproduce,
)
from pepper_drake.errors import InputError
from pepper_drake.files import write_atomically
from pepper_drake.hardware.options import (
    add_link_options,
    add_robot_address,
    check_station,
)
from pepper_drake.hardware.perform_run import perform_with_robot
from pepper_drake.hardware.run_options import hardware_run
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.demonstrations.refusals import refuse_far_place
from pepper_drake.learning.dmp.correction import learn_correction
from pepper_drake.learning.dmp.joint_primitive import JointPrimitive, is_joint_primitive
from pepper_drake.models.pepper import POSTURES
from pepper_drake.optimization.ratings import BEST_SCORE, load_scores
from pepper_drake.results.folder import INTERRUPTED, whole_results
from pepper_drake.scenario import Scenario, save_scenario
from pepper_drake.systems.guiding.external_force import ForcePulse
from pepper_drake.web.announcement import wait_for_browser
from pepper_drake.web.drake_page import open_meshcat

RESULTS = ("report.json", "log.npz", "recording.html", "corrected.yaml", "scenario.yaml")
"""Output files of a run, besides the demonstration in corrected/."""

REACHED = 0.01
"""Largest distance of the hand from a reached goal [m]."""


SIMULATED_ONLY: dict[str, object] = {
    "push": None,
    "learn_corrections": False,
    "no_waiting": False,
    "stiffness": None,
    "live": False,
}
"""Options for the simulation only, and their defaults."""


def main() -> int:
    """Runs the app and returns its exit code."""
    arguments = parse()
    is_robot = check_station(arguments, SIMULATED_ONLY)
    scenario = chosen_scenario(arguments)
    quiet_libraries()
    primitive, arm = load(arguments, scenario.learning)
    if is_robot:
        check_robot_takes(scenario, "station", "compliance.stiffness")
        return perform_on_robot(arguments, primitive, arm, scenario)
    pushes: tuple[ForcePulse, ...] = ()
    if arguments.push is not None:
        pushes = (ForcePulse(tuple(arguments.push), arguments.push_at, arguments.push_for),)
    params = ReproductionParams(
        stiffness=scenario.compliance.stiffness,
        tracking=None if arguments.no_waiting else scenario.compliance.tracking,
        ik=scenario.controller,
        station=scenario.reaching_config().station,
    )
    start = time.perf_counter()

    def keep(result: ReproductionResult) -> None:
        seconds = time.perf_counter() - start
        with whole_results(arguments.output / INTERRUPTED, ()) as inside:
            save_log(result, inside / "log.npz")
            report = make_report(arguments, arm, result, seconds, interrupted=True)
            save_report(report, inside)

    with open_meshcat(page=arguments.live, host=arguments.host) as (meshcat, shown):
        if shown is not None:
            wait_for_browser(shown)  # Any interrupt ends it.
        with stop_on_interrupt() as should_stop:
            result = reproduce(
                primitive,
                arm,
                ReproductionOptions(
                    goal=None if arguments.goal is None else np.array(arguments.goal),
                    pushes=pushes,
                    params=params,
                    meshcat=meshcat,
                    realtime=arguments.live,
                    progress=shows_progress(arguments),
                    should_stop=should_stop,
                    keep=keep,
                ),
            )
            interrupted, page = should_stop(), meshcat.StaticHtml()
    if result is None:
        return EXIT_INTERRUPTED
    seconds = time.perf_counter() - start
    report = make_report(arguments, arm, result, seconds, interrupted=interrupted)
    with whole_results(arguments.output, RESULTS) as folder:
        save_log(result, folder / "log.npz")
        (folder / "recording.html").write_text(page)
        save_scenario(scenario, folder / "scenario.yaml")
        if arguments.learn_corrections and not interrupted:
            correction = learn_correction(primitive, result.motion)
            correction.primitive.save(folder / "corrected.yaml")
            correction.demonstration.save(folder / "corrected")
            report["correction"] = correction.deviation
        save_report(report, folder)
    shutil.rmtree(arguments.output / INTERRUPTED, ignore_errors=True)
    return tell(arguments, report, result, interrupted=interrupted)


def chosen_scenario(arguments: argparse.Namespace) -> Scenario:
    """Returns the scenario of the options."""
    scenario = replace(scenario_of(arguments), seed=arguments.seed)
    if arguments.stiffness is not None:
        scenario.compliance.stiffness = arguments.stiffness
    scenario.check()
    return scenario


def perform_on_robot(
    arguments: argparse.Namespace, primitive: MovementPrimitive, arm: str, scenario: Scenario
) -> int:
    """Performs the movement with a robot, and writes the results."""
    goal = None if arguments.goal is None else np.array(arguments.goal)
    start = time.perf_counter()
    params = ReproductionParams(tracking=scenario.compliance.tracking, ik=scenario.controller)
    with stop_on_interrupt() as should_stop:
        run = hardware_run(arguments, should_stop)
        result, fault, interrupted = perform_with_robot(primitive, arm, run, goal, params)
    if result is None and fault is not None:
        raise fault
    if result is None:
        return EXIT_INTERRUPTED
    seconds = time.perf_counter() - start
    report = make_report(arguments, arm, result, seconds, interrupted=interrupted)
    report |= {"address": run.access.address, "fault": fault.word if fault else ""}
    if fault is not None:
        report |= {"outcome": "failed", "reason": fault.word, "message": str(fault)}
    with whole_results(arguments.output, RESULTS) as folder:
        save_log(result, folder / "log.npz")
        save_scenario(scenario, folder / "scenario.yaml")
        save_report(report, folder)
    return tell(arguments, report, result, interrupted=interrupted)


def tell(
    arguments: argparse.Namespace,
    report: dict[str, object],
    result: ReproductionResult,
    *,
    interrupted: bool,
) -> int:
    """Prints the outcome, and returns the exit code."""
    if arguments.score is not None and not interrupted:
        add_score(arguments.scores, arguments.score)
    if not arguments.quiet:
        print(
            f"{report['outcome']}: {1000 * result.final_position_error:.1f} mm from the goal "
            f"after {report['simulated_seconds']:.1f} s, results in {arguments.output}"
        )
    if interrupted:
        return EXIT_INTERRUPTED
    return EXIT_DONE if report["outcome"] == "reached" else EXIT_FAILED


def parse() -> argparse.Namespace:
    """Reads the command line."""
    parser = make_parser("reproduce", __doc__)
    source = parser.add_mutually_exclusive_group()
    source.add_argument("--demo", type=Path, metavar="DIR", help="demonstration to learn first")
    source.add_argument("--primitive", type=Path, metavar="FILE", help="primitive to perform")
    parser.add_argument(
        "--arm", choices=("left", "right"), default="right", help="default: %(default)s"
    )
    parser.add_argument(
        "--goal",
        type=float,
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="goal of the hand in the torso frame [m] (default: the movement's own)",
    )
    parser.add_argument(
        "--push",
        type=float,
        nargs=3,
        metavar=("FX", "FY", "FZ"),
        help="force on the hand, ahead, left and up [N]",
    )
    parser.add_argument(
        "--push-at",
        type=float,
        default=1.5,
        metavar="S",
        help="when to push (default: %(default)s s)",
    )
    parser.add_argument(
        "--push-for",
        type=float,
        default=0.5,
        metavar="S",
        help="for how long (default: %(default)s s)",
    )
    parser.add_argument(
        "--stiffness",
        type=float,
        metavar="S",
        help="stiffness of the arm, as NAOqi has it, from 0 (limp) to 1 (default: the scenario's, "
        f"{ComplianceConfig.stiffness:g})",
    )
    parser.add_argument(
        "--no-waiting",
        action="store_true",
        help="let the movement continue while the hand is pushed",
    )
    parser.add_argument(
        "--learn-corrections",
        action="store_true",
        help="learn a new primitive from the motion as it was pushed",
    )
    parser.add_argument("--score", type=float, help=f"rating of the motion, 0 to {BEST_SCORE:g}")
    parser.add_argument(
        "--scores",
        type=Path,
        default=Path("scores.txt"),
        metavar="FILE",
        help="file that the score is added to (default: %(default)s)",
    )
    parser.add_argument("--live", action="store_true", help="show it in a browser in real time")
    add_host_option(parser)
    add_robot_address(parser)
    add_link_options(parser)
    add_scenario_options(parser, ("learning", "station", "controller", "compliance"))
    arguments = cli.parse(parser)
    if not arguments.push_for > 0.0:
        raise InputError("--push-for must be above 0")
    if arguments.score is not None and not 0.0 <= arguments.score <= BEST_SCORE:
        raise InputError(f"--score {arguments.score:g} must be from 0 to {BEST_SCORE:g}")
    for name in ("goal", "push"):
        if not np.all(np.isfinite(getattr(arguments, name) or [0.0])):
            raise InputError(f"--{name} must be three finite numbers")
    if arguments.goal is not None:
        refuse_far_place(arguments.goal, "--goal")
    return arguments


def load(arguments: argparse.Namespace, learning: LearningParams) -> tuple[MovementPrimitive, str]:
    """Returns the primitive and the arm that performs it."""
    if arguments.primitive is None:
        return make_primitive(arguments.demo, arguments.arm, learning), arguments.arm
    if is_joint_primitive(arguments.primitive):
        joints = JointPrimitive.load(arguments.primitive)
        others = dict(POSTURES["stand"])
        primitive = joints.hand_primitive(others)
    else:
        primitive = MovementPrimitive.load(arguments.primitive)
    if primitive.posture is None:
        raise InputError(f"{arguments.primitive}: no joints in it; learn it with joints")
    return primitive, "left" if primitive.posture.names[0].startswith("L") else "right"


def make_report(
    arguments: argparse.Namespace,
    arm: str,
    result: ReproductionResult,
    wall_seconds: float,
    *,
    interrupted: bool,
) -> dict[str, object]:
    """Returns the content of `report.json`."""
    reason, message = "", ""
    if interrupted:
        reason, message = "interrupted", "the run was ended before it was over"
    elif result.final_position_error > REACHED:
        reason, message = "not_reached", "the hand did not come to its goal"
    elif not result.keeps_limits:
        reason, message = "limit_passed", "a joint passed a limit of its position or its speed"
    return {
        "outcome": "failed" if reason else "reached",
        "reason": reason,
        "message": message,
        "arm": arm,
        "push": arguments.push,
        "final_position_error": result.final_position_error,
        "worst_joint_speed": result.worst_joint_speed,
        "limit_overrun": result.limit_overrun,
        "desired_velocity_step": result.desired_velocity_step,
        "hand_velocity_step": result.hand_velocity_step,
        "largest_slowdown": float(result.slowdowns.max()),
        "simulated_seconds": float(result.motion.times[-1]),
        "wall_seconds": wall_seconds,
        "seed": arguments.seed,
    }


def save_report(report: dict[str, object], folder: Path) -> None:
    """Writes `report.json`."""
    (folder / "report.json").write_text(json.dumps(report, indent=2) + "\n")


def save_log(result: ReproductionResult, path: Path) -> None:
    """Writes the motion as arrays, with the units in their names."""
    motion = result.motion
    np.savez_compressed(
        path,
        time_s=motion.times,
        phase=motion.phases,
        slowdown=result.slowdowns,
        hand_position_torso_m=motion.positions,
        hand_quaternion_torso=motion.rotations,
        desired_position_torso_m=result.desired_positions,
        joint_position_rad=motion.joints,
        goal_position_torso_m=motion.goal,
    )


def add_score(path: Path, score: float) -> None:
    """Adds a line to a file of scores."""
    scores = [*(load_scores(path) if path.exists() else []), score]
    write_atomically(path, "".join(f"{score:g}\n" for score in scores))


if __name__ == "__main__":
    run(main)
