"""Commands of the robot's hands: sent once for each change, with stiffness while they grip."""

import asyncio
import contextlib
from collections.abc import Callable
from typing import Any

import numpy as np

from pepper_drake.hardware.hand_over import SOFT
from pepper_drake.hardware.link_clock import LinkClock
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.mailbox import STREAM
from pepper_drake.hardware.transport import Transport
from pepper_drake.naoqi.constants import CYCLE, HANDS

FRACTION = 0.5
"""Share of a hand's largest speed with which it opens and closes."""
_LAST_CALL = 0.5
"""Timeout of reducing the hands' stiffness at the end [s]."""


async def drive_hands(transport: Transport, newest: Callable[[], Any], clock: LinkClock) -> None:
    """Opens and closes the hands as commanded, until cancelled.

    `openHand` and `closeHand` let a hand go limp at their end; a hand that is to hold a thing stays
    stiff until the end of the run, when its stiffness is reduced, so that its motor cools.

    Args:
        transport: The robot.
        newest: Returns the newest command, of dtype `mailbox.COMMAND`.
        clock: The link's.

    Raises:
        LinkFault: The robot answered with an error, or the connection is lost.
    """
    sent: dict[str, float] = {}
    try:
        while True:
            command = newest()
            if int(command["mode"]) == STREAM:
                for name, wanted in zip(HANDS, map(float, command["hands"]), strict=True):
                    if np.isnan(wanted) or sent.get(name) == wanted:
                        continue
                    if name not in sent:
                        await transport.call("ALMotion", "setStiffnesses", name, 1.0)
                    await transport.call("ALMotion", "setAngles", name, wanted, FRACTION)
                    sent[name] = wanted
            await clock.pause(CYCLE)
    finally:
        if sent and not transport.is_lost:
            with contextlib.suppress(LinkFault, TimeoutError):
                async with asyncio.timeout(_LAST_CALL):
                    await transport.call("ALMotion", "setStiffnesses", list(sent), SOFT)
