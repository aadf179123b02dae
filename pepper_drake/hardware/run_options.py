"""Configuration of a run with a robot, from the options of `pepper_drake.hardware.options`."""

from argparse import Namespace
from collections.abc import Callable

from tqdm import tqdm

from pepper_drake.hardware.dead_man import KEYBOARD, dead_man_key
from pepper_drake.hardware.options import robot_access
from pepper_drake.hardware.preflight import PreflightOptions
from pepper_drake.hardware.robot_run import HardwareRun


def hardware_run(options: Namespace, should_stop: Callable[[], bool]) -> HardwareRun:
    """Returns the options of a robot run from the command line.

    Raises:
        InputError: The address is missing, or the dead man's switch is not available.
    """
    dead_man = "" if options.unattended else options.pad or KEYBOARD
    key = dead_man_key(dead_man)
    if key is not None:
        key.close()  # The link's process reads it.
    return HardwareRun(
        robot_access(options),
        PreflightOptions(disable_life=options.disable_life),
        should_stop,
        lambda line: None if options.quiet else tqdm.write(line),
        holds=options.hold_at_end,
        clock_rate=options.clock_rate,
        dead_man=dead_man,
        protects_arms=options.arm_protection == "on",
    )
