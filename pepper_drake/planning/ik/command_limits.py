"""The one limiter of joint commands: position, coupled position, speed and acceleration.

A command is limited so that braking stays possible: after every step the joints can come to a
stand within their acceleration limits before any position limit (viability, as in Del Prete 2018,
doi 10.1109/LRA.2017.2738321, here exact in discrete time). Thus there is always a next step that
keeps every limit, whatever is asked for, a stop included.
"""

import math

import numpy as np
import numpy.typing as npt
from numba import njit

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.models.pepper import CoupledLimit

Vector = npt.NDArray[np.float64]

_SHARES = np.linspace(0.0, 1.0, 25)
"""Shares between the desired acceleration and full braking that are tried at a coupled limit,
twice: coarse, then fine."""
_ROUNDING = 1e-10
"""Rounding allowed at a coupled limit [rad]."""


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
    following, lowest, highest = _bounded_velocities(
        position,
        velocity,
        desired_velocity,
        limits.position_lower,
        limits.position_upper,
        limits.velocity,
        limits.acceleration,
        time_step,
    )
    for coupled in limits.coupled:
        if not _is_far_inside(coupled, position, following, limits, time_step):
            _keep_coupled(coupled, position, following, lowest, highest, limits, time_step)
    return position + time_step * following, following


@njit(cache=True)
def _bounded_velocities(
    position: Vector,
    velocity: Vector,
    desired_velocity: Vector,
    lower: Vector,
    upper: Vector,
    fastest: Vector,
    acceleration: Vector,
    time_step: float,
) -> tuple[Vector, Vector, Vector]:
    """Velocities (n,) nearest to the desired inside all but coupled limits, and their bounds."""
    wished, lowest, highest = np.empty((3, len(position)))
    for k in range(len(position)):
        change, top = acceleration[k] * time_step, fastest[k]
        slow, fast = velocity[k] - change, velocity[k] + change
        # A command that is too fast brakes as hard as it may.
        least = min(max(slow, -top), fast)
        most = max(min(fast, top), slow)
        up = _stoppable_velocity(upper[k] - position[k], change, time_step)
        down = -_stoppable_velocity(position[k] - lower[k], change, time_step)
        least, most = min(max(least, down), most), max(min(most, up), least)
        wish = 0.0 if math.isnan(desired_velocity[k]) else desired_velocity[k]
        lowest[k], highest[k], wished[k] = least, most, min(max(wish, least), most)
    return wished, lowest, highest


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
    desired = _tracking_velocities(
        position, wish, previous_wish, limits.velocity, limits.acceleration, time_step
    )
    return limit_joint_command(position, velocity, desired, limits=limits, time_step=time_step)


@njit(cache=True)
def _tracking_velocities(
    position: Vector,
    wish: Vector,
    previous_wish: Vector,
    fastest: Vector,
    acceleration: Vector,
    time_step: float,
) -> Vector:
    """Velocities (n,) with which commands follow their wishes, and catch up with them."""
    desired = np.empty(len(position))
    for k in range(len(position)):
        reference = (wish[k] - previous_wish[k]) / time_step
        if not abs(reference) <= fastest[k] + _ROUNDING:
            reference = 0.0
        error = wish[k] - position[k] - time_step * reference
        desired[k] = np.nan
        if math.isfinite(error):
            change = acceleration[k] * time_step
            desired[k] = reference + _stoppable_velocity(error, change, time_step)
    return desired


def clamp_to_position_limits(position: Vector, limits: CommandLimits) -> Vector:
    """The joint positions (n,) nearest to given ones within all position limits [rad].

    A dependent joint is moved into the range that its leading joint leaves it.
    """
    clamped = np.clip(position, limits.position_lower, limits.position_upper)
    for coupled in limits.coupled:
        lower, upper = coupled.limits_at(float(clamped[coupled.leader]))
        clamped[coupled.follower] = min(max(float(clamped[coupled.follower]), lower), upper)
    return clamped


def stopping_distance(speed: float, change: float, time_step: float) -> float:
    """Distance that a joint goes on while it brakes, in steps of `time_step` [rad].

    Args:
        speed: Absolute velocity of the last step [rad/s].
        change: By how much the velocity may change in a step [rad/s].
        time_step: Time between commands [s].
    """
    steps = math.floor(speed / change)
    return time_step * steps * (speed - 0.5 * change * (steps + 1))


@njit(cache=True)
def _stoppable_velocity(distance: float, change: float, time_step: float) -> float:
    """Largest next velocity that, braking after it, ends within a signed distance.

    It solves T v + `stopping_distance`(v) = distance, which is piecewise linear in v.
    """
    share = abs(distance) / (change * time_step)
    steps = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * share) - 1.0))
    speed = change * (share + 0.5 * steps * (steps + 1)) / (steps + 1)
    return math.copysign(speed, distance)


def _is_far_inside(
    coupled: CoupledLimit,
    position: Vector,
    velocity: Vector,
    limits: CommandLimits,
    time_step: float,
) -> bool:
    """True if the follower can stop within the strictest of its limits."""
    f = coupled.follower
    speed = float(velocity[f])
    change = float(limits.acceleration[f]) * time_step
    after = float(position[f]) + time_step * speed
    stop = after + math.copysign(stopping_distance(abs(speed), change, time_step), speed)
    return coupled.strictest[0] <= min(after, stop) and max(after, stop) <= coupled.strictest[1]


def _keep_coupled(
    coupled: CoupledLimit,
    position: Vector,
    velocity: Vector,
    lowest: Vector,
    highest: Vector,
    limits: CommandLimits,
    time_step: float,
) -> None:
    """Changes a leader's and a follower's velocity so that both can brake inside their limit."""
    pair = [coupled.leader, coupled.follower]
    change = limits.acceleration[pair] * time_step
    start, wish = position[pair], velocity[pair].tolist()

    def margins(candidates: Vector) -> Vector:
        return _coupled_margins(coupled, start, candidates, change, time_step)

    below, above = margins(np.array([wish]))[0]
    if min(below, above) >= -_ROUNDING:
        return
    brake = [min(max(0.0, lowest[k]), highest[k]) for k in pair]
    away = lowest[pair[1]] if above < below else highest[pair[1]]
    # First the follower turns away from its limit, then the leader brakes, then the follower.
    corners = np.array([wish, [wish[0], away], [brake[0], away], brake])
    legs = corners[:-1, None] + _SHARES[:, None] * np.diff(corners, axis=0)[:, None]
    candidates = legs.reshape(-1, 2)
    inside = margins(candidates).min(axis=1) >= -_ROUNDING
    if inside.any():
        first = int(np.argmax(inside))
        last = candidates[max(first - 1, 0)]
        candidates = last + _SHARES[:, None] * (candidates[first] - last)
        inside = margins(candidates).min(axis=1) >= -_ROUNDING
        best = candidates[int(np.argmax(inside))].tolist()
    else:  # From outside the limit the follower moves back in.
        lower, upper = coupled.limits_at(float(start[0]))
        way = min(max(float(start[1]), lower), upper) - float(start[1])
        back = _stoppable_velocity(way, float(change[1]), time_step)
        best = [brake[0], min(max(back, lowest[pair[1]]), highest[pair[1]])]
    velocity[pair] = best


def _coupled_margins(
    coupled: CoupledLimit,
    start: Vector,
    velocities: Vector,
    change: Vector,
    time_step: float,
) -> Vector:
    """Least distance of the follower to both its limits, if both joints brake after one step.

    Args:
        coupled: The limit.
        start: Leader and follower now (2,) [rad].
        velocities: Their velocities in the next step (K, 2) [rad/s].
        change: By how much they may change in a step (2,) [rad/s].
        time_step: Time between commands [s].

    Returns:
        Distances to the lower and to the upper limit (K, 2) [rad], negative beyond.
    """
    speed = np.abs(velocities)[:, None]
    braking_steps = np.floor(speed / change)
    steps = np.minimum(np.arange(braking_steps.max() + 1.0)[None, :, None], braking_steps)
    travelled = time_step * (steps + 1.0) * (speed - change * 0.5 * steps)
    positions = start + np.sign(velocities)[:, None] * travelled  # (K, M, 2)
    leader, follower = positions[..., 0], positions[..., 1]
    return np.stack(
        (
            (follower - np.interp(leader, coupled.positions, coupled.lower)).min(axis=1),
            (np.interp(leader, coupled.positions, coupled.upper) - follower).min(axis=1),
        ),
        axis=1,
    )
