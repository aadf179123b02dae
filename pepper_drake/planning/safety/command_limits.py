"""The one limiter of joint commands: position, coupled position, speed and acceleration.

A command is limited so that braking stays possible: after every step the joints can come to a
stand within their acceleration limits before any position limit (viability, as in Del Prete 2018,
doi 10.1109/LRA.2017.2738321, here exact in discrete time). Thus there is always a next step that
keeps every limit, whatever is asked for, a stop included.
"""

import numpy as np
import numpy.typing as npt

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.ik.compiled_tick import limited_step, tracking_velocities

Vector = npt.NDArray[np.float64]


def limit_joint_command(
    position: Vector,
    velocity: Vector,
    desired_velocity: Vector,
    *,
    limits: CommandLimits,
    time_step: float,
) -> tuple[Vector, Vector]:
    """Moves joint commands by one step, inside every limit.

    The velocity is the one nearest to the desired that keeps the velocity limits, the acceleration
    limits about the present velocity, and from which the joints can brake before their position
    limits. Where a joint's range depends on another's position (ElbowRoll's on ElbowYaw,
    HeadPitch's on HeadYaw), the dependent joint gives way first, then the leading joint slows down.

    Args:
        position: Present command (n,) [rad].
        velocity: Present velocity of the command (n,) [rad/s].
        desired_velocity: Velocity asked for (n,) [rad/s]; what is not a number means zero.
        limits: Of the n joints.
        time_step: Time until the next command [s].

    Returns:
        The next command (n,) [rad] and its velocity (n,) [rad/s]. From a command within the limits
        all of them are kept; from outside it moves back in, at limited acceleration.
    """
    # Copies: compiled anew it would be for arrays that may not be written or have gaps.
    following: tuple[Vector, Vector] = limited_step(
        np.array(position, float),
        np.array(velocity, float),
        np.array(desired_velocity, float),
        limits.arrays,
        time_step,
    )
    return following


def track_joint_command(
    position: Vector,
    velocity: Vector,
    wish: Vector,
    previous_wish: Vector,
    *,
    limits: CommandLimits,
    time_step: float,
) -> tuple[Vector, Vector]:
    """Moves joint commands by one step after position commands, inside every limit.

    Wishes that keep the limits come out as they are. After any other the command catches up: its
    velocity is the wishes' own and, on top of it, the largest from which it can still brake to
    meet them. A jump of the wishes counts as a new place at rest.

    Args:
        position: Present command (n,) [rad].
        velocity: Present velocity of the command (n,) [rad/s].
        wish: Position wished for next (n,) [rad]; what is not finite means: brake.
        previous_wish: The wish before it (n,) [rad].
        limits: Of the n joints.
        time_step: Time between commands [s].

    Returns:
        The next command (n,) [rad] and its velocity (n,) [rad/s].
    """
    desired = tracking_velocities(
        np.array(position, float),
        np.array(wish, float),
        np.array(previous_wish, float),
        limits.arrays,
        time_step,
    )
    return limit_joint_command(position, velocity, desired, limits=limits, time_step=time_step)


def clamp_to_position_limits(position: Vector, limits: CommandLimits) -> Vector:
    """The joint positions (n,) nearest to given ones within all position limits [rad].

    A dependent joint is moved into the range that its leading joint leaves it.
    """
    clamped = np.clip(position, limits.position_lower, limits.position_upper)
    for coupled in limits.coupled:
        lower, upper = coupled.limits_at(float(clamped[coupled.leader]))
        clamped[coupled.follower] = min(max(float(clamped[coupled.follower]), lower), upper)
    return clamped
