"""ALMotion's time laws: how a joint moves to a target, and along timed keys.

Nothing here has state. The real robot's law is unpublished; assumed is that a joint reaches its
largest speed in 0.2 s, brakes as hard, and comes to rest at each target.
"""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicHermiteSpline

from pepper_drake.naoqi.constants import CYCLE
from pepper_drake.robot_server.robot.robot_model import MAX_VELOCITY

Vector = npt.NDArray[np.float64]

ACCELERATION: Vector = MAX_VELOCITY / 0.2
"""Acceleration of each joint under `setAngles` (17,) [rad/s^2]."""

_PEAK = 1.5
"""Largest speed of a rest-to-rest cubic for a mean speed of 1."""


def step_towards(
    position: Vector, velocity: Vector, target: Vector, speed: Vector, acceleration: Vector
) -> tuple[Vector, Vector]:
    """Moves one cycle towards targets as fast as speed and braking allow, to rest there.

    The speed is the largest from which the joint can still stop at its target in whole cycles with
    the speeds v, v - a dt, v - 2 a dt, ...: with n such steps after this one,
    v = |distance| / ((n + 1) dt) + n a dt / 2. The last one reaches the target.

    Args:
        position: Positions (n,) [rad].
        velocity: Velocities (n,) [rad/s].
        target: Targets (n,) [rad].
        speed: Largest speeds (n,) [rad/s].
        acceleration: Largest accelerations (n,) [rad/s^2].

    Returns:
        Positions (n,) and velocities (n,) a cycle later.
    """
    distance = target - position
    gap = np.abs(distance)
    braking = acceleration * CYCLE
    steps = np.floor(np.sqrt(0.25 + 2 * gap / (braking * CYCLE)) - 0.5)
    stoppable = gap / ((steps + 1) * CYCLE) + steps * braking / 2
    wanted = np.sign(distance) * np.minimum(speed, stoppable)
    new_velocity = np.clip(wanted, velocity - braking, velocity + braking)
    return position + new_velocity * CYCLE, new_velocity


def stopping_point(position: Vector, velocity: Vector, acceleration: Vector) -> Vector:
    """Returns the positions at which joints come to rest if they brake from now on (n,) [rad]."""
    braking = acceleration * CYCLE
    speed = np.abs(velocity)
    steps = np.floor(speed / braking)
    travel = (steps * speed - braking * steps * (steps + 1) / 2) * CYCLE
    return position + np.sign(velocity) * travel


def duration_with_speed(distance: float, max_speed: float) -> float:
    """Returns the duration [s] of a rest-to-rest cubic with a given largest speed."""
    return max(_PEAK * abs(distance) / max_speed, CYCLE)


def sample_keys(
    start: float, velocity: float, times: Sequence[float], values: Sequence[float]
) -> Vector:
    """Samples a smooth path through timed keys, once per cycle.

    Cubic between keys. The slope at a key is the harmonic mean of its neighbours' (Fritsch and
    Butland 1984), zero at turning points, so that no key is overshot; zero at the end.

    Args:
        start: Current value.
        velocity: Current rate [1/s].
        times: Times of the keys from now, increasing (k,) [s].
        values: Keys (k,).

    Returns:
        Values after one cycle, two cycles, ... until the last key, which is hit exactly (n,).
    """
    t = np.array([0.0, *times])
    x = np.array([start, *values])
    steps = np.diff(t)
    slopes = np.diff(x) / steps
    rates = np.zeros(len(t))
    rates[0] = velocity
    before, after = slopes[:-1], slopes[1:]
    same = before * after > 0
    weight = (steps[:-1] + 2 * steps[1:]) / (3 * (steps[:-1] + steps[1:]))
    rates[1:-1][same] = (
        before[same]
        * after[same]
        / (weight[same] * after[same] + (1 - weight[same]) * before[same])
    )
    samples = CubicHermiteSpline(t, x, rates)(_grid(t[-1]))
    samples[-1] = x[-1]
    return samples


def sample_ramp(start: float, times: Sequence[float], values: Sequence[float]) -> Vector:
    """Samples straight lines between timed keys, once per cycle; as `sample_keys`."""
    samples = np.interp(_grid(times[-1]), [0.0, *times], [start, *values])
    samples[-1] = values[-1]
    return samples


Handle = tuple[int, float, float]
"""Type (0 constant, 1 linear, else Bezier), time [s] and angle [rad] relative to its key."""

BezierKey = tuple[float, Handle | None, Handle | None]
"""Angle [rad], handles before and after it; without handles the path is at rest there."""


def sample_bezier(start: float, times: Sequence[float], keys: Sequence[BezierKey]) -> Vector:
    """Samples cubic Bezier curves between timed keys, once per cycle; as `sample_keys`.

    A handle longer in time than its segment is shortened, so that time is monotone.
    """
    grid = _grid(times[-1])
    samples = np.empty(len(grid))
    t0, x0 = 0.0, start
    handle: Handle | None = None
    u = np.linspace(0.0, 1.0, 201)
    curve = np.stack([(1 - u) ** 3, 3 * u * (1 - u) ** 2, 3 * u**2 * (1 - u), u**3])
    for t3, (x3, arriving, leaving) in zip(times, keys, strict=True):
        span = t3 - t0
        inside = (grid > t0) & (grid <= t3 + 1e-9)
        kind = 3 if handle is None else handle[0]
        if kind == 0:
            segment = np.where(grid[inside] < t3 - 1e-9, x0, x3)
        elif kind == 1:
            segment = np.interp(grid[inside], [t0, t3], [x0, x3])
        else:
            t1, x1 = _handle_point(handle, span, 1.0)
            t2, x2 = _handle_point(arriving, span, -1.0)
            at = np.array([t0, t0 + t1, t3 + t2, t3]) @ curve
            value = np.array([x0, x0 + x1, x3 + x2, x3]) @ curve
            segment = np.interp(grid[inside], np.maximum.accumulate(at), value)
        samples[inside] = segment
        t0, x0, handle = t3, x3, leaving
    samples[-1] = x0
    return samples


def _handle_point(handle: Handle | None, span: float, sign: float) -> tuple[float, float]:
    if handle is None:
        return sign * span / 3, 0.0
    _, dt, dx = handle
    reach = min(abs(dt), span)
    return sign * reach, dx * (reach / abs(dt) if dt else 0.0)


def _grid(end: float) -> Vector:
    """Returns the times of the cycles up to and including `end` [s]."""
    count = max(int(np.ceil(end / CYCLE - 1e-9)), 1)
    return np.minimum(np.arange(1, count + 1) * CYCLE, end)
