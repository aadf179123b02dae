"""Pepper reaches for an object that it sees, around obstacles that it sees.

It looks at the goal object (which carries an ArUco marker), takes in the scene with its depth
camera, drives up, and performs the movement that it was taught, bent around the obstacles.

  reach.py                              the table of the report's figure 4.1
  reach.py --scene shelf --arm left     another scene, the other arm
  reach.py --goal-motion up             the object moves while the arm is on its way
  reach.py --push 0 0 5                 somebody pushes the hand on its way
  reach.py --robot worn --seed 3        a used robot: slack, offsets, slip, latency
  reach.py --robot worn --seed 3 --calibration out/calibrate/calibration.yaml
  reach.py --fault depth:stuck@reach    the depth camera's image freezes when the arm starts
  reach.py --set planner.clearance.want=0.02
  reach.py --scenario out/reach/scenario.yaml     the same run again
  reach.py --no-avoidance               what happens without the obstacle coupling
  reach.py --scene post --method reactive     the coupling alone bends it, nothing is adapted
  reach.py --method adapted reactive report     the methods beside one another, in methods.png
  reach.py --tasks lift                 then wait, grip, lift, put down, let go, return; or a file
  reach.py --live                       watch it in a browser, in real time
  reach.py --station naoqi --robot tcp://192.168.1.10:9559     a real Pepper, or a served one

Results: report.json, log.npz, recording.html (open it in any browser), path.png, timeline.png,
scene.png. While it runs, what there is of it is kept in interrupted/. Exit code 0: reached; 1: not
reached, the report says why; 2: bad input; 130: ended by Ctrl-C or SIGTERM.
"""

import math
import multiprocessing
import shutil
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path

from pepper_drake import cli
from pepper_drake.cli_robot import add_robot_options, coupling_name
from pepper_drake.cli_scenario import add_scenario_options, scenario_of
from pepper_drake.cli_scene import add_scene_options, chosen_scene
from pepper_drake.compiled import announce_compilation
from pepper_drake.diagrams.factory import (
    prepare_scene,
)
from pepper_drake.diagrams.reach_result import ReachResult, keep_result, save_result
from pepper_drake.diagrams.reach_simulation import ReachSimulation, RunOptions
from pepper_drake.errors import InputError
from pepper_drake.hardware.options import (
    add_link_options,
    check_station,
    robot_access,
)
from pepper_drake.hardware.reach_run import reach_with_robot
from pepper_drake.hardware.run_options import hardware_run
from pepper_drake.models.pepper import MODELS_DIR
from pepper_drake.models.robot_calibration import load_calibration
from pepper_drake.models.robot_wear import ROBOTS
from pepper_drake.reporting.method_figure import MethodRun, draw_methods
from pepper_drake.reporting.reach_figures import save_reach_figures
from pepper_drake.reporting.scene_picture import save_scene_picture
from pepper_drake.results.folder import INTERRUPTED, whole_results
from pepper_drake.results.reach_log import ReachLog
from pepper_drake.results.reach_report import ReachReport
from pepper_drake.scenario import (
    METHODS,
    Scenario,
    build_reaching,
    coupling_of,
    load_tasks,
    movement_and_config,
    save_scenario,
    use_method,
)
from pepper_drake.user_code import named_part, register_code
from pepper_drake.web.announcement import wait_for_browser
from pepper_drake.web.drake_page import open_meshcat

RESULTS = (
    "report.json",
    "scene.yaml",
    "scenario.yaml",
    "log.npz",
    "recording.html",
    "path.png",
    "timeline.png",
    "scene.png",
)
"""Output files of a run."""

SIMULATED_ONLY: dict[str, object] = {
    "goal_motion": None,
    "moving": False,
    "push": None,
    "no_avoidance": False,
    "unvetted": False,
    "live": False,
}
"""Options for the simulation only, and their defaults."""


def make_parser() -> ArgumentParser:
    """Makes the parser of this app's options."""
    parser = cli.make_parser("reach", __doc__, seed_of_scenario=True)
    add_scene_options(parser)
    add_scenario_options(parser)
    add_robot_options(parser, addresses=True)
    parser.add_argument(
        "--demo",
        type=Path,
        metavar="PATH",
        help="a demonstration of a right arm: a folder with translation.txt and rotation.txt, or "
        "one text file of ten columns (default: the one that ships)",
    )
    parser.add_argument(
        "--tasks",
        metavar="NAME|FILE",
        help="what the arm does after the reach: lift (wait, close the hand, lift, put down, "
        "open, return), or a YAML file with a list of tasks, see docs/howto/chains.md",
    )
    parser.add_argument("--arm", choices=("left", "right"), help="default: the scene's")
    parser.add_argument(
        "--goal-motion",
        metavar="MOTION",
        help="move the goal object 8 cm once the arm starts: up, aside, away; or a file with rows "
        "of time x y z (s and m, offsets in the world frame)",
    )
    parser.add_argument(
        "--method",
        nargs="+",
        choices=METHODS,
        metavar="METHOD",
        help="how it gets around obstacles. adapted: the movement is bent by the barrier, and "
        "adapted for the whole arm where that is not enough (default); reactive: the barrier "
        "alone; report: the report's method, equations 2.4 to 2.8 with LWR and 40 basis functions, "
        "unchecked. Several: each is run, with a goal that stays and one that moves up, and "
        "methods.png shows them beside one another",
    )
    parser.add_argument(
        "--coupling",
        type=coupling_name,
        metavar="NAME",
        help="how obstacles bend the movement: barrier, report (its equation 2.7), or FILE.py:NAME "
        "of your own (default: the scene's)",
    )
    parser.add_argument(
        "--planner",
        metavar="FILE.py:NAME",
        help="a planner of your own, a subclass of pepper_drake.planning.ReachPlanner",
    )
    parser.add_argument(
        "--no-avoidance", action="store_true", help="leave the obstacle coupling out"
    )
    parser.add_argument(
        "--no-collision-check",
        "--unvetted",  # Its name in release 0.1.
        action="store_true",
        dest="unvetted",
        help="start whatever is in the way, and do not stop for it: the coupling alone avoids it, "
        "as in the report",
    )
    parser.add_argument(
        "--accept-unknown",
        action="store_true",
        help="let arm and base pass space that the depth camera has not seen; otherwise Pepper "
        "looks there first, and does not go if it stays unseen",
    )
    parser.add_argument(
        "--push",
        type=float,
        nargs=3,
        metavar=("FX", "FY", "FZ"),
        help="push at the hand for half a second, on its way, with this force in the world's axes "
        "[N]; the arm is soft then, gives way, and waits",
    )
    parser.add_argument(
        "--push-at",
        type=float,
        default=1.5,
        metavar="S",
        help="when to push, after the arm has started (default: %(default)s s)",
    )
    parser.add_argument(
        "--gentle",
        action="store_true",
        help="move 4 times as slowly as taught, with joints at 15 %% of their rated speed at most",
    )
    parser.add_argument(
        "--live", action="store_true", help="show it in a browser in real time, and stay open"
    )
    cli.add_host_option(parser)
    add_link_options(parser)
    parser.add_argument(
        "--no-recording", action="store_true", help="leave recording.html out, which is faster"
    )
    return parser


def chosen_scenario(options: Namespace) -> Scenario:
    """Returns the scenario of the options."""
    scenario = scenario_of(options)
    scene = chosen_scene(options, scenario.scene)
    scenario.scene = prepare_scene(scene, arm=options.arm, motion=options.goal_motion)
    if options.method:
        use_method(scenario, options.method[0])
    if options.coupling is not None:
        scenario.scene.coupling = named_part(options.coupling)
    if options.planner is not None:
        scenario.planner_class = register_code(options.planner)
    if options.seed is not None:
        scenario.seed = options.seed
    if options.demo is not None:
        scenario.demonstration = str(options.demo)
    if options.robot in ROBOTS and options.robot != "ideal":
        scenario.robot = options.robot
    if options.calibration is not None:
        scenario.calibration = options.calibration
    if options.fault:
        scenario.faults = options.fault
    if options.tasks is not None:
        shipped = MODELS_DIR / "tasks" / f"{options.tasks}.yaml"
        scenario.tasks = load_tasks(shipped if shipped.is_file() else Path(options.tasks))
    if options.push is not None:
        if not all(map(math.isfinite, (*options.push, options.push_at))):
            raise InputError("--push and --push-at must be finite numbers")
        scenario.push, scenario.push_at = list(options.push), options.push_at
    scenario.station.goal_motion_port |= options.goal_motion is not None
    scenario.station.obstacle_motion_ports |= options.moving
    scenario.avoid_obstacles &= not options.no_avoidance
    scenario.planner.collision_checked &= not options.unvetted
    scenario.planner.unseen.allow_motion |= options.accept_unknown
    scenario.gentle |= options.gentle
    scenario.check()
    return scenario


def main() -> int:
    """Runs the app."""
    options = cli.parse(make_parser())
    is_robot = check_station(options, SIMULATED_ONLY)
    cli.quiet_libraries()
    if options.method and options.coupling:
        raise InputError("--method names its own coupling; leave --coupling out")
    several = len(options.method or ()) > 1
    if several and (is_robot or options.live or options.goal_motion):
        raise InputError(
            "several methods are run in simulation: leave out --station, --live and "
            "--goal-motion, or give one method"
        )
    if is_robot:
        return reach_with_hardware(options)
    if several:
        return compare_methods(options)
    return reach(options)


def compare_methods(options: Namespace) -> int:
    """Reaches by several methods with a still and a moving goal, and plots them together."""
    runs: dict[str, dict[str, MethodRun]] = {"still": {}, "goal_up": {}}
    folder, methods, motions = options.output, options.method, {"still": None, "goal_up": "up"}
    for which, motion in motions.items():
        for method in dict.fromkeys(methods):
            options.method, options.goal_motion = [method], motion
            options.output = folder / f"{method}_{which}"
            if not options.quiet:
                print(f"{method}, {'the goal moves up' if motion else 'the goal stays'}:")
            # Each in its own process: a diagram with cameras takes a gigabyte of memory.
            process = multiprocessing.get_context("fork").Process(target=_exit, args=(options,))
            process.start()
            process.join()
            if process.exitcode not in (cli.EXIT_DONE, cli.EXIT_FAILED):
                return process.exitcode or cli.EXIT_FAILED
            log = ReachLog.load(options.output / "log.npz")
            runs[which][method] = MethodRun(log, ReachReport.load(options.output / "report.json"))
    scene = runs["still"][methods[0]].report.scene
    draw_methods(runs["still"], runs["goal_up"], scene).savefig(folder / "methods.png", dpi=110)
    if not options.quiet:
        print(f"The methods beside one another: {folder / 'methods.png'}")
    return cli.EXIT_DONE


def _exit(options: Namespace) -> None:
    """Reaches once and exits with the exit code."""
    sys.exit(reach(options))


def reach(options: Namespace) -> int:
    """Reaches once, in simulation, and writes the results."""
    scenario = chosen_scenario(options)
    if cli.shows_progress(options):
        announce_compilation()
    reaching = build_reaching(scenario)
    with open_meshcat(page=options.live, host=options.host) as (meshcat, page):
        if page is not None:
            wait_for_browser(page)
        drawn = options.live or not options.no_recording
        with cli.stop_on_interrupt() as should_stop:
            run = ReachSimulation(
                reaching,
                RunOptions(
                    meshcat=meshcat if drawn else None,
                    record=not options.no_recording,
                    realtime=options.live,
                    progress=cli.shows_progress(options),
                    should_stop=should_stop,
                    keep=lambda result: keep_result(result, options.output / INTERRUPTED),
                ),
            )
            result = run.run()
            interrupted = should_stop()
        save(result, run, scenario, options.output)
        if not options.quiet:
            print(result.report.summary())
            print(f"Results are in {options.output}")
        if interrupted:
            return cli.EXIT_INTERRUPTED
        if options.live:
            cli.wait_for_interrupt("Press Ctrl-C to end.")
    return cli.EXIT_DONE if result.report.outcome == "reached" else cli.EXIT_FAILED


def reach_with_hardware(options: Namespace) -> int:
    """Reaches once with a robot, and writes the results."""
    scenario = chosen_scenario(options)
    calibration, scenario.calibration = scenario.calibration, ""  # Only for a simulated robot.
    primitive, config = movement_and_config(scenario)
    if calibration:
        config.station.calibration = load_calibration(Path(calibration))
        config.station.calibration.check_robot(robot_access(options).address)
    with cli.stop_on_interrupt() as should_stop:
        result = reach_with_robot(
            scenario.scene,
            primitive,
            coupling_of(scenario),
            config,
            hardware_run(options, should_stop),
        )
        interrupted = should_stop()
    result.save(options.output)
    if not options.quiet:
        print(f"Results are in {options.output}")
    if interrupted:
        return cli.EXIT_INTERRUPTED
    return cli.EXIT_DONE if result.report.outcome == "reached" else cli.EXIT_FAILED


def save(result: ReachResult, run: ReachSimulation, scenario: Scenario, folder: Path) -> None:
    """Writes all results, and removes the intermediate ones."""
    with whole_results(folder, RESULTS) as inside:
        save_result(result, inside)
        save_scenario(scenario, inside / "scenario.yaml")
        save_reach_figures(result.log, inside)
        save_scene_picture(result.scene, *run.final_positions(), inside / "scene.png")
    shutil.rmtree(folder / INTERRUPTED, ignore_errors=True)


if __name__ == "__main__":
    cli.run(main)
