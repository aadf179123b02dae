"""Back the way the arm came, when something comes in its way and there is no other."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.trajectories.joint_trajectories import minimum_jerk

Vector = npt.NDArray[np.float64]

_SAMPLE_TIME = 0.02
"""Time between the configurations of a retreat [s]."""
_DURATIONS = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0)
"""Durations of a retreat [s]: the first in which the joints keep their limits is taken."""
_BRAKING = 0.75
"""Share of the acceleration that braking may take; the rest is for the way back."""
_STRONGEST_BRAKING = 3.94
"""The greatest deceleration of `_braked` from 1 rad/s within 1 s [rad/s²]."""
_STEP = 3
"""Stride through the travelled path."""

_LOST = 0.01
"""On its way the arm may lose so much of its clearance [m]."""

_NEAR = 0.6
"""Distance [m] from the goal beyond which points are out of the arm's reach."""

NEWCOMER_DISTANCE = 0.03
"""A point this far from all that was seen when the movement was planned is new [m]."""
NEWCOMER_DEPTH = 0.10
"""Depth [m] to which new points are extruded: of what hangs in the air, such as an arm, a camera
from above sees the upper side alone."""

NEWCOMER_SIDE = 0.04
"""Dilation [m] of new points for planning around them."""
MOVING_SIDE = 0.05
"""The same [m] where something moves: the part nearest to the camera is not measured."""


def extrude_new_points_down(cloud: Vector, known: cKDTree, around: Vector) -> Vector:
    """A cloud with what is new in it extended downwards.

    Args:
        cloud: (P, 3) what is seen now, m, z up.
        known: Of what was seen when the movement was planned, (K, 3) [m].
        around: (3,) m: only what is near this is held against it.

    Returns:
        (Q, 3), the cloud first.
    """
    new = new_points(cloud, known, around)
    depths = np.arange(1, round(NEWCOMER_DEPTH / 0.02) + 1) * 0.02
    below = new - np.multiply.outer(depths, np.array([0.0, 0.0, 1.0]))[:, None]
    return np.concatenate((cloud, below.reshape(-1, 3)))


def dilate_new_points(
    cloud: Vector, known: cKDTree, around: Vector, side: float = NEWCOMER_SIDE
) -> Vector:
    """A cloud with what is new in it extended to all sides.

    Of what came only the side towards the camera was seen, and it may move on: who plans around it
    keeps away a little more than from what was known before.

    Args:
        cloud: (P, 3) what is seen now, m, z up.
        known: Of what was seen when the movement was planned, (K, 3) [m].
        around: (3,) m: only what is near this is held against it.
        side: By how much [m].

    Returns:
        (Q, 3), the cloud first.
    """
    new = new_points(cloud, known, around)
    steps = side * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    return np.concatenate((cloud, (new + steps[:, None]).reshape(-1, 3)))


def new_points(cloud: Vector, known: cKDTree, around: Vector) -> Vector:
    """Returns the points (N, 3) of a cloud that are near a place and were not there before.

    Args:
        cloud: (P, 3) what is seen now [m].
        known: Of what was seen before, (K, 3) [m].
        around: (3,) only what is near this is held against it [m].
    """
    near = cloud[np.sum((cloud - around) ** 2, axis=1) < _NEAR**2]
    if not len(near):
        return near
    far = known.query(near, distance_upper_bound=NEWCOMER_DISTANCE)[0]
    return near[~np.isfinite(far)]


def retreat_trajectory(
    came: Vector,
    position: Vector,
    velocity: Vector,
    clearances: Callable[[Vector], Vector],
    room: float,
    limits: CommandLimits,
) -> tuple[Vector, float]:
    """A path of the joints back to where there is room.

    The arm brakes and goes back the way it came, to the nearest posture with that much room, or
    else to the one with most.

    Args:
        came: (N, 5) the way so far, the last the nearest to where the arm is [rad].
        position: (5,) where it is [rad].
        velocity: (5,) rad/s.
        clearances: Least distances (M,) [m] to what is seen, for postures (M, 5).
        room: m.
        limits: Of the joints.

    Returns:
        Joints (N, 5) at even times, rad, and the duration [s].
    """
    back = came[::-1]
    around = clearances(back[::_STEP])
    # Who is near something goes away from it, but not through it.
    nearer = np.minimum.accumulate(around) < min(around[0], room) - _LOST
    if nearer.any():
        around = around[: np.argmax(nearer)]
    enough = np.flatnonzero(around >= room)
    end = int(_STEP * (enough[0] if len(enough) else np.argmax(around)))
    nodes = np.arange(end + 1)
    strongest = limits.acceleration
    # However long the way back is: who brakes for as long goes far in the wrong direction.
    stopping = float(np.max(_STRONGEST_BRAKING * np.abs(velocity) / (_BRAKING * strongest)))
    for duration in _DURATIONS:
        times = np.linspace(0.0, duration, round(duration / _SAMPLE_TIME) + 1)
        share = minimum_jerk(times / duration)
        way = np.stack(
            [np.interp(share * end, nodes, back[: end + 1, k]) for k in range(5)], axis=1
        )
        path = way + (1.0 - share)[:, None] * (position - back[0])
        path += np.multiply.outer(_braked(times, stopping), velocity)
        step = times[1]
        rates = np.diff(path, axis=0) / step
        if (
            duration >= stopping
            and np.all(np.abs(rates) <= limits.velocity)
            and np.all(np.abs(np.diff(rates, axis=0)) <= strongest * step)
        ):
            break
    return np.clip(path, limits.position_lower, limits.position_upper), duration


def _braked(times: Vector, duration: float) -> Vector:
    """Displacement (N,) [rad] of 1 rad/s that is braked and made up for within a duration [s].

    The quintic polynomial of slope one at the start, and all else zero.
    """
    if duration == 0.0:
        return np.zeros_like(times)
    s = np.minimum(times / duration, 1.0)
    return np.asarray(duration * (s - 6 * s**3 + 8 * s**4 - 3 * s**5))
