"""Serve a simulated Pepper to any NAOqi client, at an address that programs take for a robot's.

The robot has dynamics, contacts, cameras with noise and time stamps, and arms that go limp. Its
clock slows where the machine is too slow. `--extras-port` serves what no robot knows: the truth,
and what a person does beside it, who leads a hand, touches a sensor, or moves the goal.

  serve_naoqi.py --scene table
  serve_naoqi.py --show reach    an arm that goes limp is led, and the chest pressed
  serve_naoqi.py --set station.noise=false     other numbers of the robot
  python -c 'import qi; s = qi.Session(); s.connect("tcp://127.0.0.1:9559"); ...'
"""

import asyncio
import contextlib
import math
import signal
import time
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable
from pathlib import Path

from pepper_drake import cli
from pepper_drake.cli_scenario import add_scenario_options, scenario_of
from pepper_drake.cli_scene import add_scene_options, chosen_scene
from pepper_drake.errors import InputError
from pepper_drake.files import read_text
from pepper_drake.models.guide import GUIDES, GuideScript, load_guide
from pepper_drake.robot_server.faults_on_demand import FaultsOnDemand
from pepper_drake.robot_server.ground_truth_service import make_extras
from pepper_drake.robot_server.robot.simulated_robot import SimulatedRobot
from pepper_drake.robot_server.robot.simulator import LATENCY, SimulatorConfig
from pepper_drake.robot_server.served_pepper import ServedPepper
from pepper_drake.robot_server.serving import keep_serving
from pepper_drake.robot_server.shown_movement import show_when_limp
from pepper_drake.robot_server.wire.connection import Credentials
from pepper_drake.robot_server.wire.server import LOOPBACK, PORT, QiServer
from pepper_drake.robot_server.wire.tls import server_context
from pepper_drake.scenario import Scenario, save_scenario
from pepper_drake.signals import run_async


def make_parser() -> ArgumentParser:
    """Makes the parser of the command line."""
    parser = cli.make_parser("serve_naoqi", __doc__, seed_of_scenario=True)
    add_scene_options(parser)
    add_scenario_options(parser, ("seed", "scene", "station"))
    parser.add_argument("--port", type=port, default=PORT, help="port (default: %(default)s)")
    parser.add_argument(
        "--extras-port",
        type=port,
        metavar="PORT",
        help="port of the truth and of faults (default: the next one)",
    )
    parser.add_argument(
        "--host",
        default=LOOPBACK,
        metavar="ADDRESS",
        help="listen at this address of the machine, 0.0.0.0 for all; then a password is demanded "
        "(default: this computer only)",
    )
    parser.add_argument(
        "--password-file",
        type=Path,
        metavar="FILE",
        help="file with USER:PASSWORD in its first line, which clients have to give",
    )
    parser.add_argument("--tls", action="store_true", help="serve tcps, encrypted, instead of tcp")
    parser.add_argument(
        "--show",
        metavar="NAME|FILE",
        help="a person shows a limp arm a movement, then presses the chest button: a script that "
        f"ships ({', '.join(GUIDES)}) or a YAML file, as record.py --guide takes",
    )
    parser.add_argument(
        "--rate",
        type=rate,
        default=1.0,
        help="rate of the robot's clock beside the wall's, such as 0.5 (default: %(default)s)",
    )
    parser.add_argument(
        "--turbo", action="store_true", help="simulate as fast as the machine can, for tests"
    )
    return parser


def port(text: str) -> int:
    """Parses a port; 0 stands for a free one."""
    if not text.isdecimal() or int(text) > 65535:
        raise ArgumentTypeError(f'"{text}" is not a port; give a number from 0 to 65535')
    return int(text)


def rate(text: str) -> float:
    """Parses the rate of the robot's clock."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.01 <= value <= 1.0:
        raise ArgumentTypeError(f'"{text}" is not a rate; give a number from 0.01 to 1')
    return value


def read_credentials(path: Path | None) -> Credentials | None:
    """Reads user and password.

    Raises:
        InputError: The file has no line USER:PASSWORD.
    """
    if path is None:
        return None
    user, colon, password = read_text(path).partition("\n")[0].strip().partition(":")
    if not colon or not password:
        raise InputError(f"{path}, line 1: must be USER:PASSWORD")
    return Credentials(user, password)


def chosen_scenario(options: Namespace) -> Scenario:
    """Returns the scenario of the options."""
    served = Scenario()
    served.station.camera_latency = LATENCY * served.station.camera_period
    scenario = scenario_of(options, served)
    scenario.scene = chosen_scene(options, scenario.scene)
    if options.seed is not None:
        scenario.seed = options.seed
    if not scenario.station.cameras:
        raise InputError("station.cameras is false; a served robot has its cameras")
    scenario.station.obstacle_motion_ports = False  # Nothing moves the obstacles.
    return scenario


async def serve(
    robot: SimulatedRobot,
    make_server: Callable[..., QiServer],
    ports: tuple[int, int | None],
    say: Callable[[str], None],
    files: Path,
    shown: GuideScript | None = None,
) -> None:
    """Serves the robot until the program is interrupted."""
    pepper = ServedPepper(robot, log=say, files=files)
    server = make_server(pepper.services, port=ports[0])
    pepper.finder = server
    await server.start()
    extras_port = ports[1] if ports[1] is not None else server.port + 1 if ports[0] else 0
    faults = FaultsOnDemand(pepper.services, server.restart)
    extras = make_server([make_extras(robot, faults)], port=extras_port)
    await extras.start()
    say(f"Pepper is served at {server.address}, what no robot knows at {extras.address}")
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    person = None
    if shown is not None:
        person = asyncio.create_task(show_when_limp(shown, robot, pepper.motion, say))
        person.add_done_callback(lambda _: stop.set())  # It ends only by an error.
    try:
        await keep_serving(pepper, robot, stop, say)
        if person is not None and person.done():
            person.result()
    finally:
        if person is not None:
            person.cancel()
        await server.close()
        await extras.close()


def main() -> int:
    """Runs the app."""
    options = cli.parse(make_parser())
    cli.quiet_libraries()
    credentials = read_credentials(options.password_file)

    def say(line: str) -> None:
        if not options.quiet:
            print(line, flush=True)

    shown = load_guide(options.show) if options.show is not None else None
    tls = server_context(options.host) if options.tls else None

    def make_server(services: list, *, port: int) -> QiServer:
        return QiServer(
            services, host=options.host, port=port, credentials=credentials, tls=tls, log=say
        )

    make_server([], port=0)  # Refuses a disallowed host before the robot starts.
    scenario = chosen_scenario(options)
    save_scenario(scenario, options.output / "scenario.yaml")
    config = SimulatorConfig(
        scenario.scene,
        scenario.reaching_config().station,
        0.0 if options.turbo else options.rate,
        epoch=time.time(),
    )
    with SimulatedRobot(config) as robot:
        robot.wait_until_ready()
        with contextlib.suppress(KeyboardInterrupt):
            ports = options.port, options.extras_port
            run_async(serve(robot, make_server, ports, say, options.output / "robot", shown))
    return cli.EXIT_DONE


if __name__ == "__main__":
    cli.run(main)
