"""Command-line options that choose the robot and its faults."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Collection

from pepper_drake.errors import InputError
from pepper_drake.models.robot_wear import ROBOTS
from pepper_drake.models.scene import COUPLINGS
from pepper_drake.systems.faults.fault import KINDS, SIGNALS, parse_faults
from pepper_drake.systems.faults.fault_set import FaultSet
from pepper_drake.user_code import names_code


def coupling_name(text: str) -> str:
    """Parses the name of a coupling, or FILE.py:NAME."""
    if text not in COUPLINGS and not names_code(text):
        known = ", ".join(COUPLINGS)
        raise ArgumentTypeError(f"'{text}' is not a coupling; use one of {known}, or FILE.py:NAME")
    return text


def add_robot_options(parser: ArgumentParser, *, addresses: bool = False) -> None:
    """Adds `--robot`, `--calibration` and `--fault`.

    Args:
        parser: Of an app.
        addresses: Whether a robot's address may be given, too.
    """
    parser.add_argument(
        "--robot",
        type=str,
        choices=None if addresses else ROBOTS,
        metavar="ideal|worn|ADDRESS" if addresses else None,
        default="ideal",
        help=(
            "with --station naoqi the address of a Pepper, as tcp://192.168.1.10:9559, or of "
            "apps/serve_naoqi.py; simulated, ideal or "
            if addresses
            else ""
        )
        + "worn: joints with slack, encoders with offsets, cameras slightly misaligned, "
        "wheels that slip, commands that come late, all drawn from the seed (default: %(default)s)",
    )
    parser.add_argument(
        "--calibration",
        metavar="FILE",
        help="the calibration.yaml that calibrate.py made of this robot; "
        "{seed} in the name stands for the seed",
    )
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="SIGNAL:KIND@START[+DURATION]",
        help="inject a fault into a signal, as in depth:stuck@4+2 or encoders:garbage@reach; may "
        f"be given more than once. Signals: {', '.join(SIGNALS)}. Kinds: {', '.join(KINDS)}. Start "
        'and duration in s; "reach": when the arm starts',
    )


def chosen_faults(options: Namespace, signals: Collection[str] | None = None) -> FaultSet:
    """The faults that `--fault` names.

    Args:
        options: Of `add_robot_options`, with a seed.
        signals: The signals that can fail here; all if left out.

    Raises:
        InputError: One of them is not a fault, or its signal does not exist here.
    """
    faults = parse_faults(options.fault)
    for fault in faults:
        if signals is not None and fault.signal not in signals:
            raise InputError(
                f"the fault {fault} makes no sense in this app; what can fail here is "
                f"{', '.join(signals)}"
            )
    return FaultSet(faults, options.seed)
