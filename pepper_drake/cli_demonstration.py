"""Command-line options for what a recording does not state."""

from argparse import ArgumentParser, Namespace

from pepper_drake.learning.demonstrations.importers.options import (
    ANGLES,
    FRAMES,
    LENGTHS,
    QUATERNIONS,
    TIMES,
    ImportOptions,
)


def add_import_options(parser: ArgumentParser) -> None:
    """Adds the options of `ImportOptions`."""
    group = parser.add_argument_group("what the file does not say")
    add = group.add_argument
    add("--unit", choices=tuple(LENGTHS), help="unit of lengths (default: the file's, else m)")
    add("--angle", choices=tuple(ANGLES), help="unit of angles (default: the file's, else rad)")
    add("--time", choices=tuple(TIMES), help="unit of times (default: the file's, else s)")
    add("--rate", type=float, metavar="HZ", help="samples per second, where the file has no times")
    add("--quaternion", choices=QUATERNIONS, help="order of a quaternion's columns")
    add("--frame", choices=FRAMES, help="frame of positions; base_footprint: on the floor")
    add("--up", choices=("y", "z"), help="axis that points up; y becomes z")
    add("--arm", choices=("left", "right"), help="the arm to take, where both are recorded")
    add(
        "--plane",
        type=float,
        nargs=6,
        metavar=("X", "Y", "Z", "ROLL", "PITCH", "YAW"),
        help="pose [m, rad] in the torso frame of the plane on which a path of two dimensions lies",
    )
    add(
        "--start",
        type=float,
        nargs=3,
        metavar=("X", "Y", "Z"),
        help="where the motion starts in the torso frame [m]: it is shifted there",
    )
    add(
        "--track",
        metavar="NAME",
        help="the motion to take from a file with several: its name or number",
    )
    add("--drop-outliers", action="store_true", help="leave out samples that jump away and back")
    add(
        "--clip-joints",
        action="store_true",
        help="clip joint angles to their limits, as NAOqi does",
    )


def import_options(arguments: Namespace) -> ImportOptions:
    """Returns the import options of the command line.

    Raises:
        InputError: A number is not finite.
    """
    return ImportOptions(
        unit=arguments.unit,
        angle=arguments.angle,
        time=arguments.time,
        quaternion=arguments.quaternion,
        frame=arguments.frame,
        arm=arguments.arm,
        up=arguments.up,
        plane=None if arguments.plane is None else tuple(arguments.plane),
        start=None if arguments.start is None else tuple(arguments.start),
        rate=arguments.rate,
        track=arguments.track,
        drop_outliers=arguments.drop_outliers,
        clip_joints=arguments.clip_joints,
    )
