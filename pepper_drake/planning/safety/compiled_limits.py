"""Compiled limits of joint commands: position, coupled position, velocity and acceleration."""

import math

import numpy as np
import numpy.typing as npt

from pepper_drake.compiled import compiled
from pepper_drake.models.control_model import LimitArrays

Vector = npt.NDArray[np.float64]

SHARES = 24
"""Number of steps from the desired acceleration to full braking in the search at a coupled limit,
first coarse, then fine."""
ROUNDING = 1e-10
"""Tolerance of velocity limits [rad/s] and coupled position limits [rad]."""


@compiled
def stopping_distance(speed: float, change: float, time_step: float) -> float:
    """Returns the braking distance of a joint, in steps of `time_step` [rad].

    Args:
        speed: Absolute velocity of the last step [rad/s].
        change: Largest velocity change per step [rad/s].
        time_step: Time between commands [s].
    """
    steps = math.floor(speed / change)
    return time_step * steps * (speed - 0.5 * change * (steps + 1))


@compiled
def stoppable_velocity(distance: float, change: float, time_step: float) -> float:
    """Returns the largest next velocity from which braking ends within a signed distance.

    It solves T v + `stopping_distance`(v) = distance, which is piecewise linear in v.
    """
    share = abs(distance) / (change * time_step)
    steps = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * share) - 1.0))
    speed = change * (share + 0.5 * steps * (steps + 1)) / (steps + 1)
    return math.copysign(speed, distance)


@compiled
def tracking_velocities(
    position: Vector,
    desired_position: Vector,
    previous_desired_position: Vector,
    limits: LimitArrays,
    time_step: float,
) -> Vector:
    """Returns velocities (n,) with which commands follow, or catch up with, desired positions."""
    desired = np.empty(len(position))
    for k in range(len(position)):
        reference = (desired_position[k] - previous_desired_position[k]) / time_step
        if not abs(reference) <= limits.velocity[k] + ROUNDING:
            reference = 0.0
        error = desired_position[k] - position[k] - time_step * reference
        desired[k] = np.nan
        if math.isfinite(error):
            change = limits.acceleration[k] * time_step
            desired[k] = reference + stoppable_velocity(error, change, time_step)
    return desired


@compiled
def limited_step(
    position: Vector, velocity: Vector, desired: Vector, limits: LimitArrays, time_step: float
) -> tuple[Vector, Vector]:
    """Returns the next command (n,) [rad], its velocity (n,) [rad/s]; see `limit_joint_command`."""
    following, lowest, highest = np.empty((3, len(position)))
    for k in range(len(position)):
        change, top = limits.acceleration[k] * time_step, limits.velocity[k]
        slow, fast = velocity[k] - change, velocity[k] + change
        # A command above the velocity limit brakes at the acceleration limit.
        least = min(max(slow, -top), fast)
        most = max(min(fast, top), slow)
        up = stoppable_velocity(limits.upper[k] - position[k], change, time_step)
        down = -stoppable_velocity(position[k] - limits.lower[k], change, time_step)
        least, most = min(max(least, down), most), max(min(most, up), least)
        wish = 0.0 if math.isnan(desired[k]) else desired[k]
        lowest[k], highest[k], following[k] = least, most, min(max(wish, least), most)
    for c in range(len(limits.pairs)):
        _keep_coupled(c, position, following, lowest, highest, limits, time_step)
    return position + time_step * following, following


@compiled
def _interpolated(x: float, nodes: Vector, values: Vector) -> float:
    """Interpolates linearly between nodes, constant beyond them, like numpy.interp."""
    if x <= nodes[0]:
        return values[0]
    if x >= nodes[-1]:
        return values[-1]
    j = np.searchsorted(nodes, x, side="right") - 1
    return (values[j + 1] - values[j]) / (nodes[j + 1] - nodes[j]) * (x - nodes[j]) + values[j]


@compiled
def _coupled_margins(
    table: Vector, start: Vector, velocities: Vector, change: Vector, time_step: float
) -> tuple[float, float]:
    """Returns the follower's least distances to its limits if both joints brake after one step.

    Args:
        table: (3, K) leader positions, and the follower's lower and upper limits there [rad].
        start: Present positions of leader and follower (2,) [rad].
        velocities: Their velocities in the next step (2,) [rad/s].
        change: Their largest velocity changes per step (2,) [rad/s].
        time_step: Time between commands [s].

    Returns:
        Distance to the lower and to the upper limit [rad], negative beyond.
    """
    below, above, place = np.inf, np.inf, np.empty(2)
    last = max(abs(velocities[0]) // change[0], abs(velocities[1]) // change[1])
    for step in range(int(last) + 1):
        for i in range(2):
            speed = abs(velocities[i])
            braked = min(float(step), math.floor(speed / change[i]))
            travelled = time_step * (braked + 1.0) * (speed - change[i] * 0.5 * braked)
            place[i] = start[i] + np.sign(velocities[i]) * travelled
        below = min(below, place[1] - _interpolated(place[0], table[0], table[1]))
        above = min(above, _interpolated(place[0], table[0], table[2]) - place[1])
    return below, above


@compiled
def _keep_coupled(
    number: int,
    position: Vector,
    velocity: Vector,
    lowest: Vector,
    highest: Vector,
    limits: LimitArrays,
    time_step: float,
) -> None:
    """Adjusts a leader's and a follower's velocity so that both can brake inside their limits."""
    leader, follower = limits.pairs[number]
    lower, upper = limits.strictest[number]
    speed, change_f = velocity[follower], limits.acceleration[follower] * time_step
    after = position[follower] + time_step * speed
    stop = after + math.copysign(stopping_distance(abs(speed), change_f, time_step), speed)
    if lower <= min(after, stop) and max(after, stop) <= upper:
        return  # The follower can stop within its strictest limits.
    table = limits.tables[number]
    change = np.array([limits.acceleration[leader] * time_step, change_f])
    start = np.array([position[leader], position[follower]])
    wish = np.array([velocity[leader], velocity[follower]])
    below, above = _coupled_margins(table, start, wish, change, time_step)
    if min(below, above) >= -ROUNDING:
        return
    brake_l = min(max(0.0, lowest[leader]), highest[leader])
    brake_f = min(max(0.0, lowest[follower]), highest[follower])
    away = lowest[follower] if above < below else highest[follower]
    # Search along: the follower moves away from its limit, the leader brakes, the follower brakes.
    corners = np.array([[wish[0], wish[1]], [wish[0], away], [brake_l, away], [brake_l, brake_f]])
    previous = corners[0].copy()
    for leg in range(3):
        for share in range(SHARES + 1):
            candidate = corners[leg] + share / SHARES * (corners[leg + 1] - corners[leg])
            below, above = _coupled_margins(table, start, candidate, change, time_step)
            if min(below, above) >= -ROUNDING:
                for fine in range(SHARES + 1):
                    finer = previous + fine / SHARES * (candidate - previous)
                    below, above = _coupled_margins(table, start, finer, change, time_step)
                    if min(below, above) >= -ROUNDING:
                        candidate = finer
                        break
                velocity[leader], velocity[follower] = candidate
                return
            previous = candidate
    # From outside the limit the follower moves back in.
    lower = _interpolated(start[0], table[0], table[1])
    upper = _interpolated(start[0], table[0], table[2])
    way = min(max(start[1], lower), upper) - start[1]
    back = stoppable_velocity(way, change[1], time_step)
    velocity[leader] = brake_l
    velocity[follower] = min(max(back, lowest[follower]), highest[follower])
