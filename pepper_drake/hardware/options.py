"""Command-line options of apps that drive a robot."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path

from pepper_drake.errors import InputError
from pepper_drake.files import read_text
from pepper_drake.hardware.qi_client import RobotAddress
from pepper_drake.hardware.transport import LINKS, RobotAccess
from pepper_drake.models.robot_wear import ROBOTS


def add_link_options(parser: ArgumentParser, *, required: bool = False, moves: bool = True) -> None:
    """Adds the options of the link to a robot.

    Args:
        parser: Of an app.
        required: Whether the app only works with a robot; otherwise it has `--robot` of
            `pepper_drake.cli_robot` for a simulation.
        moves: Whether the app moves the robot.
    """
    if required:
        parser.add_argument(
            "--robot",
            metavar="ADDRESS",
            required=True,
            help="address of a Pepper or of serve_naoqi.py, as tcp://192.168.1.10:9559",
        )
    else:
        parser.add_argument(
            "--station",
            choices=("simulated", "naoqi"),
            default="simulated",
            help="what is moved: the simulation, or the robot at --robot (default: %(default)s)",
        )
        parser.add_argument(
            "--clock-rate",
            type=clock_rate,
            default=1.0,
            metavar="RATE",
            help="for a served robot on a slow machine: the --rate of serve_naoqi.py (default: 1)",
        )
    parser.add_argument(
        "--password-file",
        type=Path,
        metavar="FILE",
        help="file with USER:PASSWORD in its first line, for a robot that demands them",
    )
    parser.add_argument(
        "--link",
        choices=LINKS,
        default=LINKS[0],
        help="how to talk to the robot: our own protocol client, or libqi (default: %(default)s)",
    )
    parser.add_argument(
        "--disable-life",
        action="store_true",
        help="switch off the robot's autonomous life, which would move its arms",
    )
    if not moves:
        return
    key = parser.add_mutually_exclusive_group()
    key.add_argument(
        "--pad",
        metavar="DEVICE",
        help="a game pad, as /dev/input/js0: the robot moves while one of its buttons is held "
        "(default: while the space bar is)",
    )
    key.add_argument(
        "--unattended",
        action="store_true",
        help="run without a dead man's switch: the robot moves although nobody holds a key",
    )
    parser.add_argument(
        "--arm-protection",
        choices=("on", "off"),
        default="on",
        help="the robot's own protection, which slows or stalls its arms over a table; off: the "
        "arms keep moving, and only you watch for collisions (default: %(default)s)",
    )
    parser.add_argument(
        "--hold-at-end",
        action="store_true",
        help="leave the arm stiff at the end; without it the arm is lowered and relaxed",
    )


def add_robot_address(parser: ArgumentParser) -> None:
    """Adds `--robot` to an app whose simulated robot has no faults and no wear."""
    parser.add_argument(
        "--robot",
        default="ideal",
        metavar="ADDRESS",
        help="with --station naoqi: address of a Pepper or of serve_naoqi.py, as "
        "tcp://192.168.1.10:9559",
    )


def clock_rate(text: str) -> float:
    """Reads the rate of a clock from the command line."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.01 <= value <= 1.0:
        raise ArgumentTypeError(f'"{text}" is not a rate; give a number from 0.01 to 1')
    return value


def robot_access(options: Namespace) -> RobotAccess:
    """Returns address and credentials of the robot from the options.

    Raises:
        InputError: The address is missing or malformed, or the password's file cannot be read.
    """
    if options.robot in ROBOTS:
        raise InputError("--station naoqi needs --robot ADDRESS, as tcp://192.168.1.10:9559")
    address = str(RobotAddress.parse(options.robot))
    user = password = ""
    if options.password_file is not None:
        line = read_text(options.password_file).partition("\n")[0].strip()
        user, colon, password = line.partition(":")
        if not colon or not password:
            raise InputError(f"{options.password_file}, line 1: must be USER:PASSWORD")
    return RobotAccess(address, user, password, options.link)


def check_station(options: Namespace, simulated_only: dict[str, object]) -> bool:
    """Returns whether the app drives a robot.

    Args:
        options: Of the app.
        simulated_only: Options of simulations only, by name, with their defaults.

    Raises:
        InputError: A robot is named without --station naoqi, or an option is for simulations only.
    """
    if options.station == "simulated":
        if options.robot not in ROBOTS:
            raise InputError(
                f"--robot {options.robot} is none to simulate; it is {' or '.join(ROBOTS)}, or an "
                "address with --station naoqi"
            )
        return False
    for name, default in simulated_only.items():
        if getattr(options, name) != default:
            flag = "--" + name.replace("_", "-")
            raise InputError(f"{flag} is for the simulation; leave it out with --station naoqi")
    return True
