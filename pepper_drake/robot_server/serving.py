"""The services' cycle, synchronised with the robot's clock."""

import asyncio
from collections.abc import Callable

from pepper_drake.naoqi.constants import CYCLE
from pepper_drake.robot_server.robot.simulated_robot import SimulatedRobot
from pepper_drake.robot_server.robot.simulator import SLOWEST_SHOWN
from pepper_drake.robot_server.served_pepper import ServedPepper

_LOOK = 0.002
"""Polling period of the robot's clock [s]."""
_SETTLED = 250
"""Cycles after which the measured rate of the clock has settled."""


async def keep_serving(
    pepper: ServedPepper, robot: SimulatedRobot, stop: asyncio.Event, say: Callable[[str], None]
) -> None:
    """Steps the services once every 20 ms of the robot's clock, until told to stop.

    After a pause missed cycles are skipped, as in ALMotion, never caught up in a burst.

    Args:
        pepper: The services.
        robot: The robot.
        stop: Set to end.
        say: Prints a line for the user.

    Raises:
        PepperDrakeError: The simulation ended.
    """
    cycle, cycles, has_warned = -1, 0, False
    while not stop.is_set():
        now = round(robot.state().time / CYCLE)
        if now != cycle:
            cycle, cycles = now, cycles + 1
            pepper.step()
            if cycles % 50 == 0:
                robot.check()
                rate = float(robot.record()["rate"])
                if not has_warned and cycles > _SETTLED and rate < SLOWEST_SHOWN:
                    has_warned = True
                    say(
                        f"this machine is too slow: the robot's clock runs at {rate:.2f} of the "
                        "rate that was asked for; --rate sets a slower one"
                    )
        await asyncio.sleep(_LOOK)
