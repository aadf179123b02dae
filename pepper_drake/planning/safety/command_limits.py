"""The only limiter of joint commands: position, coupled position, speed and acceleration.

Commands are limited to viable states: after every step the joints can brake, within their
acceleration limits, before any position limit (as in Del Prete 2018,
doi 10.1109/LRA.2017.2738321, here exact in discrete time). So there is always a next step that
keeps every limit, whatever the desired motion, stops included.
"""

import numpy as np
import numpy.typing as npt

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.safety.compiled_limits import limited_step, tracking_velocities

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

    The new velocity is the one nearest to the desired velocity that keeps the velocity limits and
    the acceleration limits, and from which the joints can brake before their position limits. Where
    a joint's range depends on another's position (ElbowRoll's on ElbowYaw, HeadPitch's on HeadYaw),
    the dependent joint gives way first, then the leading joint slows down.

    Args:
        position: Present command (n,) [rad].
        velocity: Present velocity of the command (n,) [rad/s].
        desired_velocity: Desired velocity (n,) [rad/s]; NaN means zero.
        limits: Limits of the n joints.
        time_step: Time until the next command [s].

    Returns:
        The next command (n,) [rad] and its velocity (n,) [rad/s]. It keeps all limits if the
        present command does; otherwise it moves back inside, at limited acceleration.
    """
    # Copies: read-only or non-contiguous arrays would trigger another compilation.
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
    desired_position: Vector,
    previous_desired_position: Vector,
    *,
    limits: CommandLimits,
    time_step: float,
) -> tuple[Vector, Vector]:
    """Moves joint commands by one step towards desired positions, inside every limit.

    Desired positions that keep the limits are output unchanged. Otherwise the command catches up:
    its velocity is that of the desired positions plus the largest from which it can still brake to
    meet them. A jump of the desired positions counts as a new target at rest.

    Args:
        position: Present command (n,) [rad].
        velocity: Present velocity of the command (n,) [rad/s].
        desired_position: Next desired position (n,) [rad]; where it is not finite the joint brakes.
        previous_desired_position: The desired position before it (n,) [rad].
        limits: Limits of the n joints.
        time_step: Time between commands [s].

    Returns:
        The next command (n,) [rad] and its velocity (n,) [rad/s].
    """
    desired = tracking_velocities(
        np.array(position, float),
        np.array(desired_position, float),
        np.array(previous_desired_position, float),
        limits.arrays,
        time_step,
    )
    return limit_joint_command(position, velocity, desired, limits=limits, time_step=time_step)


def clamp_to_position_limits(position: Vector, limits: CommandLimits) -> Vector:
    """Returns the joint positions (n,) nearest to given ones within all position limits [rad].

    A dependent joint is clamped to its range at the leading joint's position.
    """
    clamped = np.clip(position, limits.position_lower, limits.position_upper)
    for coupled in limits.coupled:
        lower, upper = coupled.limits_at(float(clamped[coupled.leader]))
        clamped[coupled.follower] = min(max(float(clamped[coupled.follower]), lower), upper)
    return clamped
