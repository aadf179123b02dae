"""Retreat along the travelled path from a new obstacle, when there is no detour."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pepper_drake.errors import InputError
from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.trajectories.joint_trajectories import minimum_jerk

Vector = npt.NDArray[np.float64]

_STRONGEST_BRAKING = 3.94
"""The greatest deceleration of `_braked` from 1 rad/s within 1 s [rad/s²]."""


@dataclass
class RetreatParams:
    """Retreat along the travelled path."""

    sample_time: float = 0.02
    """Time between the configurations of a retreat [s]."""
    durations: list[float] = field(default_factory=lambda: [0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0])
    """Durations of a retreat [s]: the first in which the joints keep their limits is taken."""
    braking_share: float = 0.75
    """Share of the acceleration that braking may take; the rest is for the retreat."""
    stride: int = 3
    """Stride through the travelled path where its clearance is computed."""
    lost: float = 0.01
    """Clearance that the arm may lose on its way back [m]."""

    def check(self) -> None:
        """Raises InputError for times or strides that are not positive, or no durations."""
        times = [self.sample_time, *self.durations]
        if not self.durations or min(times) <= 0.0 or self.braking_share <= 0.0 or self.stride < 1:
            raise InputError(
                "planner.retreat: sample_time, braking_share, stride and all durations, of which "
                "there must be one at least, must be positive"
            )
        if 4.0 * self.sample_time > min(self.durations):
            raise InputError(
                f"planner.retreat.sample_time is {self.sample_time:g} s; it must be at most a "
                f"quarter of the shortest of planner.retreat.durations, {min(self.durations):g} s"
            )


@dataclass
class NewObstacleParams:
    """Obstacles that were not there when the movement was planned, and their unseen sides."""

    near: float = 0.6
    """Distance from the goal beyond which points are out of the arm's reach [m]."""
    distance: float = 0.03
    """A point this far from all that was seen when the movement was planned is new [m]."""
    fewest: int = 10
    """Fewer new points are at the edges of what was known."""
    depth: float = 0.10
    """Depth to which new points are extruded [m]: of what hangs in the air, such as an arm, a
    camera from above sees the upper side alone."""
    depth_step: float = 0.02
    """Distance between the points of that extrusion [m]."""
    side: float = 0.04
    """Dilation of new points for planning around them [m]."""
    stands_within: float = 0.08
    """Distance within which something is predicted again, after a wait, that stands there [m]:
    where it is too near to be measured it is known as well as that."""
    moving_side: float = 0.05
    """The same where something moves [m]: the part nearest to the camera is not measured."""
    hanging_above: float = 0.05
    """Height of free space below something that hangs in the air, and so may move [m]."""
    hanging_gap: float = 0.03
    """Points of such a thing have neighbours nearer than this [m]."""
    left_within: float = 0.2
    """Time within which a retreat that is not slowed down gains distance from new points [s]: an
    image's period."""

    def check(self) -> None:
        """Raises InputError for a step that is not positive."""
        if not self.depth_step > 0.0:
            raise InputError(
                f"planner.new_obstacle.depth_step is {self.depth_step:g} m; it must be positive"
            )


DEFAULT_RETREAT, DEFAULT_NEW_OBSTACLE = RetreatParams(), NewObstacleParams()
"""Parameters of functions that are given none."""


def extrude_new_points_down(
    cloud: Vector,
    known: cKDTree,
    around: Vector,
    params: NewObstacleParams = DEFAULT_NEW_OBSTACLE,
) -> Vector:
    """A cloud with what is new in it extended downwards.

    Args:
        cloud: (P, 3) what is seen now, m, z up.
        known: Of what was seen when the movement was planned, (K, 3) [m].
        around: (3,) m: only what is near this is held against it.
        params: Depth of the extrusion.

    Returns:
        (Q, 3), the cloud first.
    """
    new = new_points(cloud, known, around, params)
    step = params.depth_step
    depths = np.arange(1, round(params.depth / step) + 1) * step
    below = new - np.multiply.outer(depths, np.array([0.0, 0.0, 1.0]))[:, None]
    return np.concatenate((cloud, below.reshape(-1, 3)))


def dilate_new_points(
    cloud: Vector,
    known: cKDTree,
    around: Vector,
    *,
    moving: bool = False,
    params: NewObstacleParams = DEFAULT_NEW_OBSTACLE,
) -> Vector:
    """A cloud with what is new in it extended to all sides.

    Only the side of a new obstacle towards the camera was seen, and it may move: plans keep a
    larger distance from it than from what was known before.

    Args:
        cloud: (P, 3) what is seen now, m, z up.
        known: Of what was seen when the movement was planned, (K, 3) [m].
        around: (3,) m: only what is near this is held against it.
        moving: True if something moves.
        params: Size of the dilation.

    Returns:
        (Q, 3), the cloud first.
    """
    new = new_points(cloud, known, around, params)
    side = params.moving_side if moving else params.side
    steps = side * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    return np.concatenate((cloud, (new + steps[:, None]).reshape(-1, 3)))


def new_points(
    cloud: Vector,
    known: cKDTree,
    around: Vector,
    params: NewObstacleParams = DEFAULT_NEW_OBSTACLE,
) -> Vector:
    """Returns the points (N, 3) of a cloud that are near a place and were not there before.

    Args:
        cloud: (P, 3) what is seen now [m].
        known: Of what was seen before, (K, 3) [m].
        around: (3,) only what is near this is held against it [m].
        params: Distances that make a point near and new.
    """
    near = cloud[np.sum((cloud - around) ** 2, axis=1) < params.near**2]
    if not len(near):
        return near
    far = known.query(near, distance_upper_bound=params.distance)[0]
    return near[~np.isfinite(far)]


def retreat_trajectory(
    travelled: Vector,
    position: Vector,
    velocity: Vector,
    clearances: Callable[[Vector], Vector],
    room: float,
    limits: CommandLimits,
    params: RetreatParams = DEFAULT_RETREAT,
) -> tuple[Vector, float]:
    """A joint trajectory back along the travelled path.

    The arm brakes and returns along the path to the nearest configuration with enough clearance, or
    else to the one with most.

    Args:
        travelled: (N, 5) configurations of the travelled path, the last nearest to the arm [rad].
        position: (5,) of the arm [rad].
        velocity: (5,) rad/s.
        clearances: Least distances (M,) [m] to what is seen, for postures (M, 5).
        room: Clearance that is enough [m].
        limits: Of the joints.
        params: Durations, braking and strides.

    Returns:
        Joints (N, 5) at even times, rad, and the duration [s].
    """
    back = travelled[::-1]
    around = clearances(back[:: params.stride])
    # An arm that is near an obstacle moves away from it, but not through it.
    nearer = np.minimum.accumulate(around) < min(around[0], room) - params.lost
    if nearer.any():
        around = around[: np.argmax(nearer)]
    enough = np.flatnonzero(around >= room)
    end = int(params.stride * (enough[0] if len(enough) else np.argmax(around)))
    nodes = np.arange(end + 1)
    strongest = limits.acceleration
    # Independent of the retreat's duration: long braking moves the arm on towards the obstacle.
    braking = params.braking_share * strongest
    stopping = float(np.max(_STRONGEST_BRAKING * np.abs(velocity) / braking))
    for duration in params.durations:
        times = np.linspace(0.0, duration, round(duration / params.sample_time) + 1)
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
