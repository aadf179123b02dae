"""Watchdog of the commanded arm: its motors stay stiff, and no other program commands it."""

from collections.abc import Callable

import numpy as np

from pepper_drake.hardware.arm_stream import ArmStream
from pepper_drake.hardware.link_clock import LinkClock
from pepper_drake.hardware.link_config import LinkConfig
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.transport import Transport
from pepper_drake.models.control_model import arm_joints

_PERIOD = 0.25
TAKEN_OVER = 0.15
"""Distance of the robot's own command from the range of our targets, in two successive checks, that
shows another program [rad]."""


async def watch_arm(
    transport: Transport,
    config: LinkConfig,
    stream: ArmStream,
    streams: Callable[[], bool],
    clock: LinkClock,
) -> None:
    """Watches the arm while commands are streamed, until it is cancelled.

    Args:
        transport: The robot.
        config: Of the link.
        stream: Of the commands.
        streams: True while commands are streamed.
        clock: The link's.

    Raises:
        LinkFault: A motor went limp, or another program moves the arm.
    """
    names = list(arm_joints(config.arm))
    rows = [config.joints.index(name) for name in names]
    foreign = 0
    while True:
        await clock.pause(_PERIOD)
        if not streams():
            foreign = 0
            continue
        stiffnesses = await transport.call("ALMotion", "getStiffnesses", names)
        limp = [n for n, s in zip(names, stiffnesses, strict=True) if s < 0.05]
        if limp and streams():
            raise LinkFault("stiffness_lost", ", ".join(limp))
        commanded = np.array(await transport.call("ALMotion", "getAngles", names, False))
        ours = stream.range_of_targets()
        if ours is None or stream.is_holding or not streams():
            foreign = 0
            continue
        least, largest = (target[rows] for target in ours)
        far = (commanded < least - TAKEN_OVER) | (commanded > largest + TAKEN_OVER)
        foreign = foreign + 1 if far.any() else 0
        if foreign > 1:
            who = [n for n, is_far in zip(names, far, strict=True) if is_far]
            raise LinkFault("taken_over", ", ".join(who))
