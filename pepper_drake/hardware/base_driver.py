"""Drives a robot's base in short moves, so that it stops by itself if this process dies."""

import asyncio
import contextlib
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from pepper_drake.hardware.link_clock import LinkClock
from pepper_drake.hardware.robot_commands import base_segment
from pepper_drake.hardware.transport import Transport
from pepper_drake.naoqi.constants import CYCLE


async def drive_base(
    transport: Transport,
    wanted: Callable[[], npt.NDArray[np.float64] | None],
    clock: LinkClock,
) -> None:
    """Drives at the wanted velocity until cancelled.

    Args:
        transport: The robot.
        wanted: Returns the velocity vx, vy [m/s], yaw rate [rad/s] in the base's frame, limited so
            that the base can brake at its goal; zeros to stop at once; None if unknown: the current
            move is then completed.
        clock: Of the link.

    Raises:
        LinkFault: The robot answered with an error, or the connection is lost.
    """
    move: asyncio.Task[object] | None = None
    try:
        while True:
            velocity = wanted()
            segment = None if velocity is None else base_segment(velocity)
            if move is not None and move.done():
                await move
                move = None
            if move is not None and velocity is not None and segment is None:
                await transport.call("ALMotion", "stopMove")
                await move
                move = None
            elif move is None and segment is not None:
                call = transport.call("ALMotion", "moveTo", *map(float, segment))
                move = asyncio.ensure_future(call)
            await clock.pause(CYCLE)
    finally:
        if move is not None:
            move.cancel()
            with contextlib.suppress(Exception, asyncio.CancelledError):
                await move
