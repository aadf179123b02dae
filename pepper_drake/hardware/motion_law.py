"""A joint's response to `setAngles`: its latency, and its speed for a fraction of the largest.

The streaming assumes that a joint moves at exactly the fraction of its largest speed
(`pepper_drake.naoqi.streaming`), and starts at once; a small head motion measures it. Times are the
robot's own.
"""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from time import monotonic

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import PepperDrakeError
from pepper_drake.hardware.preflight import Check
from pepper_drake.hardware.transport import Transport
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.naoqi.clock import join_time
from pepper_drake.naoqi.constants import CYCLE

Vector = npt.NDArray[np.float64]
Pause = Callable[[float], Awaitable[None]]

JOINT = "HeadYaw"
"""Joint that is moved: it carries no load, and its motion is free."""
WAY = 0.3
"""Angle of the motion [rad]."""
FRACTIONS = (0.05, 0.1, 0.2)
LONGEST = 8.0
"""Timeout of a motion [s]."""
LARGEST_DELAY = 0.25
"""Latency above which a streamed arm lags behind its path by more than its lookahead [s]."""
_KEY = f"Device/SubDeviceList/{JOINT}/Position/Sensor/Value"
_AFTER = 0.3
_STEADY = (0.25, 0.75)
"""Part of the motion in which the speed is steady."""


@dataclass(frozen=True)
class MotionLaw:
    """The fitted law.

    Attributes:
        delay: From the command until the line of steady speed leaves the start [s]: the dead time
            plus half the acceleration time.
        speed: Speed at a fraction of 1 [rad/s].
        rated: Largest speed by the robot's description [rad/s].
        spread: Largest relative deviation of a measured speed from the law.
    """

    delay: float
    speed: float
    rated: float
    spread: float


def fit_turn(times: Vector, positions: Vector) -> tuple[float, float]:
    """Fits a line to the steady part of a motion.

    Args:
        times: (N,) since the command [s].
        positions: (N,) from the start to the end of the motion [rad].

    Returns:
        Time at which the line leaves the first position [s], and its absolute slope [rad/s].

    Raises:
        PepperDrakeError: Fewer than three samples lie on the steady part.
    """
    turn = positions[-1] - positions[0]
    share = (positions - positions[0]) / turn if abs(turn) > 0.5 * WAY else np.zeros(len(positions))
    steady = (share > _STEADY[0]) & (share < _STEADY[1])
    if np.count_nonzero(steady) < 3:
        raise PepperDrakeError(f"{JOINT} did not turn as commanded, or too few states came")
    slope, offset = np.polyfit(times[steady], positions[steady], 1)
    return float((positions[0] - offset) / slope), float(abs(slope))


async def measure_motion_law(
    transport: Transport, clock: Callable[[], float] = monotonic, pause: Pause = asyncio.sleep
) -> MotionLaw:
    """Turns the head to and fro and fits the law; the head ends where it was.

    Args:
        transport: A robot that is ready, its head stiff.
        clock: Returns the current time [s], for timeouts.
        pause: Waits for a time [s].

    Raises:
        LinkFault: The robot answered with an error, or the connection is lost.
        PepperDrakeError: The head did not turn.
    """
    limits = shared_control_model().command_limits((JOINT,))
    (begin,) = await transport.call("ALMotion", "getAngles", JOINT, True)
    away = begin - WAY if begin > 0.0 else begin + WAY
    delays, speeds = [], []
    try:
        for fraction in FRACTIONS:
            for target in (away, begin):
                delay, speed = await _turn(transport, target, fraction, clock, pause)
                delays.append(delay)
                speeds.append(speed)
    finally:
        await transport.call("ALMotion", "setAngles", JOINT, float(begin), FRACTIONS[0])
    shares = np.repeat(FRACTIONS, 2)
    whole = float(shares @ speeds / (shares @ shares))
    spread = float(np.max(np.abs(np.array(speeds) / (whole * shares) - 1.0)))
    return MotionLaw(float(np.median(delays)), whole, float(limits.velocity[0]), spread)


async def _turn(
    transport: Transport, target: float, fraction: float, clock: Callable[[], float], pause: Pause
) -> tuple[float, float]:
    rows: list[tuple[float, float]] = []

    async def sample() -> tuple[float, float]:
        angle, seconds, microseconds = await transport.call("ALMemory", "getTimestamp", _KEY)
        row = join_time(seconds, microseconds), float(angle)
        if not rows or row[0] > rows[-1][0]:
            rows.append(row)
        return row

    sent, _ = await sample()
    await transport.call("ALMotion", "setAngles", JOINT, float(target), fraction)
    end = clock() + LONGEST
    while abs((await sample())[1] - target) > 0.02 * WAY and clock() < end:
        await pause(CYCLE)
    await pause(_AFTER)
    await sample()
    table = np.array(rows)
    return fit_turn(table[:, 0] - sent, table[:, 1])


def law_checks(law: MotionLaw) -> list[Check]:
    """Returns the checks of latency and speed."""
    share = law.speed / law.rated
    slow = abs(share - 1.0) > 0.2 or law.spread > 0.2
    late = law.delay > LARGEST_DELAY
    return [
        Check(
            "delay",
            f"{1000 * law.delay:.0f} ms from a command to motion",
            mend="the hand will lag behind its path" if late else "",
            is_warning=late,
        ),
        Check(
            "speed law",
            f"{share:.2f} of the fraction that is asked for, within {100 * law.spread:.0f} %",
            mend="the arm will not keep its times" if slow else "",
            is_warning=slow,
        ),
    ]
