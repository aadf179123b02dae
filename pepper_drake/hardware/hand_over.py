"""The end of a run: the arm is held, lowered if it is up, and only then relaxed."""

import asyncio
from collections.abc import Awaitable, Callable

import numpy as np
import numpy.typing as npt

from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.transport import Transport
from pepper_drake.models.control_model import arm_joints
from pepper_drake.models.pepper import arm_group
from pepper_drake.naoqi.constants import CHAINS

Vector = npt.NDArray[np.float64]
Pause = Callable[[float], Awaitable[None]]

HELD = 1.0
"""Time that the arm is held before anything else happens [s]."""
RELAXING = 2.0
"""Time in which its stiffness is reduced [s]."""
SOFT = 0.3
"""Final stiffness."""
DOWN = 1.3
"""Shoulder pitch at and above which the upper arm hangs [rad]."""
_LOWERING_SPEED = 0.3
"""Speed of lowering [rad/s]."""
_FRACTION = 0.1
_RESTS = 0.12
"""Tracking error of a shoulder whose arm rests on something [rad]."""
_POLL = 0.05


async def hand_over(
    transport: Transport, arm: str, measured: Callable[[], Vector], pause: Pause = asyncio.sleep
) -> None:
    """Holds, lowers and relaxes an arm. One that meets something on its way down is left stiff.

    Args:
        transport: The robot.
        arm: "left" or "right".
        measured: Returns the arm's current joint positions (5,) [rad].
        pause: Waits for a time [s].

    Raises:
        LinkFault: The robot answered with an error, or the connection is lost.
    """
    names = list(arm_joints(arm))
    await transport.call("ALMotion", "setAngles", names, measured().tolist(), 0.1)
    await pause(HELD)
    if not await _lower(transport, names[0], measured, pause):
        raise LinkFault(
            "arm_stalled", f"the {arm} arm met something on its way down and was left stiff"
        )
    chain = [name for name in CHAINS[arm_group(arm)[0].upper() + "Arm"] if name in names]
    await transport.call("ALMotion", "stiffnessInterpolation", chain, SOFT, RELAXING)


async def _lower(
    transport: Transport, shoulder: str, measured: Callable[[], Vector], pause: Pause
) -> bool:
    """Lowers the upper arm; returns whether it hangs."""
    target = float(measured()[0])
    while float(measured()[0]) < DOWN - _RESTS:
        if target - float(measured()[0]) > _RESTS:
            pitch = float(measured()[0])
            await transport.call("ALMotion", "setAngles", [shoulder], [pitch], _FRACTION)
            return False
        target = min(target + _LOWERING_SPEED * _POLL, DOWN)
        await transport.call("ALMotion", "setAngles", [shoulder], [target], _FRACTION)
        await pause(_POLL)
    return True
