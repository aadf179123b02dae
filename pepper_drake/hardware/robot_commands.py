"""Commands for ALMotion: targets of joints a lookahead later, and moves of the base."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.models.pepper import clamp_coupled_limits
from pepper_drake.naoqi.streaming import LARGEST_FRACTION, streamed_command

Vector = npt.NDArray[np.float64]

HEADROOM = 1.5
"""Factor on the fraction that the fastest joint needs. With it all joints run one lookahead less
one cycle ahead of the plan, whatever their speeds, to 0.3 mrad; without it, they differ by up to 9
mrad (five joints along a minimum-jerk path against the served law)."""
_SEGMENT_LENGTH = 0.2
"""Longest move of one moveTo [m], after which the base stops if its client has died."""
_BASE_ACCELERATION = (0.3, 0.75)
"""The base's own accelerations [m/s^2, rad/s^2]."""


def streamed_targets(
    names: Sequence[str], position: Vector, velocity: Vector, ahead: float, limits: CommandLimits
) -> tuple[Vector, float]:
    """Returns the arguments of `setAngles` with which joints follow a path.

    Args:
        names: Joints (n).
        position: Current position of the path (n,) [rad].
        velocity: Current velocity of the path (n,) [rad/s].
        ahead: The lookahead [s].
        limits: Of the joints.

    Returns:
        Targets within all limits (n,) [rad], and the common fraction of the largest speed.
    """
    step = np.clip(velocity, -limits.velocity, limits.velocity) * ahead
    targets = within_limits(names, position + step, limits)
    streamed = streamed_command(names, targets - step, targets, ahead, limits.velocity)
    return targets, min(HEADROOM * streamed.fraction, LARGEST_FRACTION)


def within_limits(names: Sequence[str], positions: Vector, limits: CommandLimits) -> Vector:
    """Returns positions (n,) [rad] clipped to their limits, including the yaw-coupled ones."""
    inside = np.clip(positions, limits.position_lower, limits.position_upper)
    clamped = clamp_coupled_limits(dict(zip(names, inside, strict=True)))
    return np.array([clamped[name] for name in names])


def base_segment(velocity: Vector) -> Vector | None:
    """Returns the move for a velocity of the base.

    A base that brakes at a constant rate has a distance of v^2 / (2 a) left, and one that settles
    at a rate of 5/s has v / 5: a move by the larger of both never leads beyond the goal of the
    velocity.

    Args:
        velocity: vx, vy [m/s] and yaw rate [rad/s] in the base's frame.

    Returns:
        x, y [m] and theta [rad] in the base's frame; None for no move.
    """
    if not np.isfinite(velocity).all():
        return None
    speed, turning = float(np.hypot(velocity[0], velocity[1])), abs(float(velocity[2]))
    if speed < 1e-3 and turning < 1e-3:
        return None
    length = min(max(speed**2 / (2 * _BASE_ACCELERATION[0]), speed / 5), _SEGMENT_LENGTH)
    turn = min(max(turning**2 / (2 * _BASE_ACCELERATION[1]), turning / 5), 1.0)
    move = np.zeros(3)
    if speed > 0:
        move[:2] = np.array(velocity[:2]) / speed * length
    move[2] = np.sign(velocity[2]) * turn
    return move
