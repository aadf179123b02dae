"""Teach Pepper on one page in the browser: lead its hand, and it does it again by itself.

On the page the hand of the limp arm is dragged with the mouse, or led with keys or a game pad; goal
and obstacles are dragged, too, and more obstacles added; Record, Stop, Learn, Reach, Undo and Save
are buttons and keys. A second address is for a class to watch. Nothing starts before somebody
has opened the page.

  teach.py                              open the address that it prints; Ctrl-C ends
  teach.py --arm left                   the other arm
  teach.py --scene my_scene.yaml --move mug,bottle
                                        your own scene, in which mug and bottle can be moved
  teach.py --no-cameras                 faster: Pepper knows the goal and sees no obstacles
  teach.py --lesson first               a lesson: a prepared scene and tasks, for a class
  teach.py --lesson my_lesson/          your own: a session's folder, prepared on the page
  teach.py --new                        start a new session; the earlier one is kept in earlier-1/
  teach.py --script story               do it all by itself: lead, record, learn, reach, save
  teach.py --script story --watch       the same in real time, to watch
  teach.py --station naoqi --robot tcp://192.168.1.10:9559
                                        a real Pepper, or a served one, and no page: its arm goes
                                        limp, you lead it until you press the chest button, touch
                                        the head or the other hand's back, or Ctrl-C; each time
                                        adds a demonstration, and all are learned

The page's legend tells what is drawn. Everything is kept in the output folder as it happens: a
recording while it is made, demonstrations/, what was learned in primitive.yaml, and in session.yaml
which of them count and where the objects stand. Started again, it resumes the session.
Save writes the last demonstration to demonstration/; at the end there is report.json. scenario.yaml
has the numbers of the loop.
Exit code 0: done; 1: the script did not get what it waits for; 2: bad input.
"""

import contextlib
import json
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from dataclasses import replace

from tqdm import tqdm

from pepper_drake import cli
from pepper_drake.cli_robot import (
    add_robot_options,
    chosen_faults,
    coupling_name,
)
from pepper_drake.cli_scenario import add_scenario_options, scenario_of
from pepper_drake.compiled import announce_compilation
from pepper_drake.diagrams.robot_signals import STATION_SIGNALS
from pepper_drake.errors import InputError, PepperDrakeError
from pepper_drake.files import write_atomically
from pepper_drake.hardware.options import add_link_options, check_station, robot_access
from pepper_drake.hardware.robot_recording import RobotRecordOptions
from pepper_drake.live.controls import KEYS
from pepper_drake.live.page import LivePage
from pepper_drake.live.robot_session import teach_robot
from pepper_drake.live.script import SCRIPTS, LiveScript, load_script, play
from pepper_drake.live.session import LiveSession, Mode
from pepper_drake.live.session_file import (
    DEMONSTRATIONS,
    LESSONS,
    SessionFolder,
    SessionRecord,
    find_lesson,
)
from pepper_drake.live.show import LiveApp
from pepper_drake.live.simulation import LiveSimulation
from pepper_drake.models.scene import SCENES_DIR, load_scene
from pepper_drake.scenario import NUMBERS, save_scenario
from pepper_drake.user_code import named_part
from pepper_drake.web.announcement import wait_for_browser
from pepper_drake.web.viser_page import ViserPage

TEACHING_SCENE = SCENES_DIR / "teach.yaml"
"""A goal on a stand within reach, and a ball that can be moved into the path."""


SIMULATED_ONLY: dict[str, object] = {
    "scene": None,
    "move": "",
    "coupling": None,
    "lesson": None,
    "calibration": None,
    "fault": [],
    "no_cameras": False,
    "scenario": None,
    "set": [],
    "script": None,
    "watch": False,
    "seconds": None,
    "host": None,
}
"""Options for the simulation only, and their defaults."""


def positive(text: str) -> float:
    """Parses a positive number."""
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0.0 < number < float("inf"):
        raise ArgumentTypeError(f'"{text}" is not a time; give a number of seconds above 0')
    return number


def make_parser() -> ArgumentParser:
    """Makes the parser of this app's options."""
    parser = cli.make_parser("teach", __doc__)
    parser.add_argument(
        "--scene",
        metavar="NAME|FILE",
        help="a scene in which the robot stands within reach of the goal (default: a goal on a "
        "stand and a ball)",
    )
    parser.add_argument("--arm", choices=("left", "right"), help="default: the scene's")
    parser.add_argument(
        "--move",
        default="",
        metavar="NAMES",
        help="obstacles that can be moved, with commas between (default: those with a path)",
    )
    parser.add_argument(
        "--coupling",
        type=lambda text: text if text == "none" else coupling_name(text),
        metavar="NAME",
        help="how obstacles bend the movement: barrier, report (its equation 2.7), none, or "
        "FILE.py:NAME of your own (default: the scene's)",
    )
    parser.add_argument(
        "--lesson",
        metavar="NAME|DIR",
        help=f"begin with a lesson: {', '.join(LESSONS)} or the folder of a prepared session",
    )
    parser.add_argument(
        "--new",
        action="store_true",
        help="do not resume the session in the output folder; it is kept in earlier-1/",
    )
    add_robot_options(parser, addresses=True)
    add_link_options(parser, moves=False)
    parser.add_argument("--no-cameras", action="store_true", help="do without the cameras")
    parser.add_argument(
        "--script",
        metavar="NAME|FILE",
        help=f"press the buttons by a script: {', '.join(SCRIPTS)} or a YAML file",
    )
    parser.add_argument("--watch", action="store_true", help="run the script in real time")
    parser.add_argument(
        "--seconds", type=positive, metavar="S", help="end after so much simulated time"
    )
    add_scenario_options(parser, NUMBERS)
    cli.add_host_option(parser)
    return parser


def open_folder(options: Namespace) -> tuple[SessionFolder, SessionFolder | None]:
    """Opens the session's folder, and its lesson, if any.

    Options that are not given are filled in from the stored session or the lesson.

    Raises:
        InputError: The stored session has other options, or a file cannot be read.
    """
    folder = SessionFolder(options.output)
    if options.script is not None or options.new:
        kept = folder.begin_anew()
        if kept is not None and not options.quiet:
            print(f"The earlier session is kept in {kept}.")
    resumes = folder.exists()
    name = options.lesson or folder.record.lesson
    lesson = find_lesson(name) if name else None
    if lesson is not None and options.no_cameras and set(lesson.record.offsets) - {"goal"}:
        raise InputError(
            f"--no-cameras: in the lesson {name} Pepper has to see what stands in its way;"
            " leave --no-cameras out, or the lesson"
        )
    start = folder.record if resumes else lesson.record if lesson is not None else SessionRecord()
    wanted = SessionRecord(
        lesson=options.lesson or "",
        scene=str(options.scene or ""),
        arm=options.arm or "",
        move=[name for name in options.move.split(",") if name],
    )
    for key in ("lesson", "scene", "arm", "move") if resumes else ():
        asked, stored = getattr(wanted, key), getattr(start, key)
        if asked and asked != stored:
            raise InputError(
                f"--{key}: the session in {options.output} has another ({stored or 'none'});"
                " give --new, or another --output"
            )
    record = folder.record
    record.lesson, record.script = name, options.script or ""
    record.scene = wanted.scene or start.scene
    record.arm = wanted.arm or start.arm
    record.move = wanted.move or start.move
    return folder, lesson


def make_session(options: Namespace) -> LiveSession:
    """Makes the session of the options, or resumes the one in the folder."""
    folder, lesson = open_folder(options)
    scene = load_scene(folder.record.scene or TEACHING_SCENE)
    if folder.record.arm not in ("", scene.arm):
        scene = scene.mirrored()
    folder.record.arm = scene.arm
    chosen_faults(options, STATION_SIGNALS)
    scenario = replace(
        scenario_of(options),
        scene=scene,
        seed=options.seed,
        robot=options.robot,
        calibration=options.calibration or "",
        faults=options.fault,
    )
    scenario.station.cameras &= not options.no_cameras
    config = scenario.reaching_config()
    save_scenario(scenario, options.output / "scenario.yaml")
    simulation = LiveSimulation(
        scene,
        config=config,
        movables=folder.record.move,
        coupling=options.coupling and named_part(options.coupling),
        barrier=scenario.barrier_coupling(),
        spares=options.script is None,
        realtime=options.script is None or options.watch,
    )
    session = LiveSession(simulation, folder, lesson)
    if not options.quiet and session.resumed:
        print(
            f"Resumed the session in {options.output}: {session.resumed}. --new starts a new one."
        )
    return session


def run_script(show: LiveApp, script: LiveScript, options: Namespace) -> str:
    """Plays a script and returns the error message, if any."""
    with tqdm(
        desc="acting",
        total=len(script.steps),
        unit=" step",
        leave=False,
        disable=not cli.shows_progress(options),
    ) as progress:

        def tell(line: str) -> None:
            if not options.quiet:
                tqdm.write(line)
            progress.update()

        try:
            play(show, script, tell)
        except InputError:
            raise
        except PepperDrakeError as error:
            return str(error)
    return ""


def run_live(show: LiveApp, seconds: float | None) -> None:
    """Runs the session interactively, until Ctrl-C or for a given time."""
    session = show.session
    with contextlib.suppress(KeyboardInterrupt):
        while seconds is None or session.simulation.time < seconds:
            show.step()
    if session.mode == Mode.RECORDED:
        session.stop()


def main() -> int:
    """Runs the app."""
    options = cli.parse(make_parser())
    if check_station(options, SIMULATED_ONLY):
        return teach_on_robot(options)
    script = load_script(options.script) if options.script is not None else None
    cli.quiet_libraries()
    if cli.shows_progress(options):
        announce_compilation()
    shown = script is None or options.watch
    if not shown and options.host is not None:
        raise InputError("--host: there is no page; give --watch, too")
    if not shown:
        return teach(options, script, None)
    with ViserPage(options.host, keys=KEYS) as page:
        return teach(options, script, page)


def teach_on_robot(options: Namespace) -> int:
    """Records a demonstration on a robot for the session, and learns all of them."""
    cli.quiet_libraries()
    access = robot_access(options)
    folder, _ = open_folder(options)
    arm = folder.record.arm or "right"
    with cli.stop_on_interrupt() as should_stop:
        lesson = teach_robot(
            folder,
            access,
            RobotRecordOptions(
                options.output / "recording",
                arm,
                options.disable_life,
                should_stop,
                lambda line: None if options.quiet else print(line, flush=True),
                options.clock_rate,
            ),
        )
    primitive, shown = lesson.taught.primitive, lesson.taught.shown
    assert primitive is not None
    report = {
        "outcome": "done",
        "reason": "",
        "arm": arm,
        "address": access.address,
        "ended_by": lesson.recording.ended_by or "user",
        "samples": lesson.recording.samples,
        "demonstrations": len(shown),
        "duration": primitive.duration,
        "path_length": primitive.path_length,
    }
    write_atomically(options.output / "report.json", json.dumps(report, indent=2) + "\n")
    counted = f"{len(shown)} demonstration{'s' if len(shown) > 1 else ''}"
    if not options.quiet:
        print(
            f"learned a movement of {primitive.duration:.1f} s and {primitive.path_length:.2f} m "
            f"from {counted}, in {options.output}; perform it with {cli.as_run('reach.py')} "
            f"--demo {options.output / DEMONSTRATIONS / shown[-1].name}"
        )
    return cli.EXIT_DONE


def teach(options: Namespace, script: LiveScript | None, page: ViserPage | None) -> int:
    """Runs the session, with a page if there is one."""
    session = make_session(options)
    simulation = session.simulation
    if script is not None and script.arm != simulation.arm:
        script = script.mirrored()
    controls = None
    if page is not None:
        controls = LivePage(
            page,
            cameras=not options.no_cameras,
            spares=script is None,
            lesson=session.lesson,
        )
    show = LiveApp(session, controls)
    if page is not None:
        alone = "" if options.host else " (on this computer; --host 0.0.0.0 lets a class in)"
        print(f"To watch only, open {page.class_url}{alone}", flush=True)
        if options.seconds is None:
            wait_for_browser(page)
        else:
            print(f"Open {page.url} in a browser; it starts at once.", flush=True)
        simulation.begin()
    problem = ""
    if script is not None:
        problem = run_script(show, script, options)
    else:
        run_live(show, options.seconds)
    pace = session.simulation.pace
    report = {
        "outcome": "failed" if problem else "done",
        "reason": problem,
        "arm": session.simulation.arm,
        "cameras": not options.no_cameras,
        "mode": session.mode.value,
        "status": session.status,
        "goal_distance": session.simulation.goal_distance(),
        "simulated_seconds": pace.simulated_seconds,
        "wall_seconds": pace.wall_seconds,
        "frames_per_second": pace.frames_per_second,
        "realtime_rate": pace.realtime_rate,
        "seed": options.seed,
    }
    write_atomically(options.output / "report.json", json.dumps(report, indent=2) + "\n")
    if not options.quiet:
        print(
            f"{pace.simulated_seconds:.1f} s in {pace.wall_seconds:.1f} s, "
            f"{pace.frames_per_second:.0f} frames per second; report in {options.output}"
        )
    if problem:
        raise PepperDrakeError(problem)
    return cli.EXIT_DONE


if __name__ == "__main__":
    cli.run(main)
