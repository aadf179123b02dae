"""Retreat along the travelled path from a new obstacle, when there is no detour."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import CommandLimits
from pepper_drake.perception.mapping.dynamic_obstacles import cluster_labels
from pepper_drake.planning.trajectories.joint_trajectories import minimum_jerk

Vector = npt.NDArray[np.float64]

_STRONGEST_BRAKING = 3.94
"""The greatest deceleration of `_braked` from 1 rad/s within 1 s [rad/s²]."""


@dataclass
class RetreatParams:
    """Parameters of the retreat along the travelled path."""

    sample_time: float = 0.02
    """Time between the configurations of a retreat [s]."""
    durations: list[float] = field(default_factory=lambda: [0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0])
    """Candidate durations [s]: the first in which the joints keep their limits is used."""
    braking_fraction: float = 0.75
    """Fraction of the acceleration limit for braking; the rest is for the retreat."""
    stride: int = 3
    """Stride of the samples of the travelled path whose clearance is computed."""
    max_clearance_loss: float = 0.01
    """Clearance that the arm may lose during the retreat [m]."""

    def check(self) -> None:
        """Raises InputError for times or strides that are not positive, or no durations."""
        times = [self.sample_time, *self.durations]
        if (
            not self.durations
            or min(times) <= 0.0
            or self.braking_fraction <= 0.0
            or self.stride < 1
        ):
            raise InputError(
                "planner.retreat: sample_time, braking_fraction, stride and all durations, of "
                "which there must be one at least, must be positive"
            )
        if 4.0 * self.sample_time > min(self.durations):
            raise InputError(
                f"planner.retreat.sample_time is {self.sample_time:g} s; it must be at most a "
                f"quarter of the shortest of planner.retreat.durations, {min(self.durations):g} s"
            )


@dataclass
class NewObstacleParams:
    """Detection of obstacles that appeared after planning, and the extent of their unseen sides."""

    max_goal_distance: float = 0.6
    """Distance from the goal beyond which points are out of the arm's reach [m]."""
    distance: float = 0.03
    """Distance from all points seen at planning time beyond which a point is new [m]."""
    min_points: int = 10
    """Least number of new points; fewer are noise at the edges of known obstacles."""
    spacing: float = 0.0125
    """Spacing at which they are counted [m], however dense the cloud is."""
    depth: float = 0.10
    """Depth to which new points are extruded downwards [m]: a camera from above sees only the upper
    side of an object in the air, such as an arm."""
    depth_step: float = 0.02
    """Distance between the points of that extrusion [m]."""
    dilation: float = 0.04
    """Dilation of new points for planning around them [m]."""
    stationary_tolerance: float = 0.08
    """Displacement of a predicted obstacle during a wait up to which it counts as stationary [m]:
    the accuracy of its position where it is too close to be measured."""
    moving_dilation: float = 0.05
    """`dilation` if an obstacle moves [m]: its part nearest to the camera is not measured."""
    hanging_above: float = 0.05
    """Height of free space below an object that hangs in the air, and so may move [m]."""
    hanging_share: float = 0.2
    """Least share of that space that was seen to be free; the rest may be hidden."""
    hanging_end: float = 0.05
    """Distance beyond each of its ends within which the space must have been seen to be free [m];
    otherwise such an object may come along its axis unseen, and the arm is as slow near it as near
    a new one."""
    hanging_gap: float = 0.03
    """Largest distance between neighbouring points of such an object [m]."""
    carrier_near: float = 0.12
    """Distance from the goal object's foot within which points at its height carry it [m]."""
    carrier_depth: float = 0.06
    """Height below it down to which what is connected with them belongs to it, too [m]: the front
    of a table top, below which nothing may be. It stands all the same."""
    escape_time: float = 0.2
    """Time within which a retreat must gain distance from new points to keep its full speed [s]: an
    image's period."""

    def check(self) -> None:
        """Raises InputError for a step that is not positive."""
        if not self.depth_step > 0.0:
            raise InputError(
                f"planner.new_obstacle.depth_step is {self.depth_step:g} m; it must be positive"
            )


DEFAULT_RETREAT, DEFAULT_NEW_OBSTACLE = RetreatParams(), NewObstacleParams()
"""Default parameters of the functions below."""


def extrude_new_points_down(
    cloud: Vector,
    known: PointCloudDistance,
    around: Vector,
    params: NewObstacleParams = DEFAULT_NEW_OBSTACLE,
) -> Vector:
    """Extrudes the new points of a cloud downwards.

    Args:
        cloud: Present cloud (P, 3), z up [m].
        known: Distances to the points seen at planning time, which are not extended.
        around: (3,) only points near this can be new [m].
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
    known: PointCloudDistance,
    around: Vector,
    *,
    moving: bool = False,
    params: NewObstacleParams = DEFAULT_NEW_OBSTACLE,
) -> Vector:
    """Dilates the new points of a cloud horizontally.

    Only the side of a new obstacle towards the camera was seen, and it may move: plans keep a
    larger distance from it than from known obstacles.

    Args:
        cloud: Present cloud (P, 3), z up [m].
        known: Distances to the points seen at planning time, which are not extended.
        around: (3,) only points near this can be new [m].
        moving: Whether an obstacle moves.
        params: Size of the dilation.

    Returns:
        (Q, 3), the cloud first.
    """
    new = new_points(cloud, known, around, params)
    side = params.moving_dilation if moving else params.dilation
    steps = side * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    return np.concatenate((cloud, (new + steps[:, None]).reshape(-1, 3)))


def new_points(
    cloud: Vector,
    known: PointCloudDistance,
    around: Vector,
    params: NewObstacleParams = DEFAULT_NEW_OBSTACLE,
) -> Vector:
    """Returns the points (N, 3) of a cloud that are near a place and far from all known points.

    Args:
        cloud: Present cloud (P, 3) [m].
        known: Distances to the points seen before, which are not extended.
        around: (3,) only points near this can be new [m].
        params: Distances that make a point near and new.
    """
    x, y, z = (cloud - around).T
    near = cloud.compress(x * x + y * y + z * z < params.max_goal_distance**2, axis=0)
    return near.compress(np.isinf(known.distance(near, params.distance)), axis=0)


def carries_object(
    cloud: Vector, p_WO: Vector, params: NewObstacleParams = DEFAULT_NEW_OBSTACLE
) -> npt.NDArray[np.bool_]:
    """Tells which points of a cloud belong to what the goal object stands on.

    Args:
        cloud: Cloud (P, 3) in W [m].
        p_WO: The goal object's foot (3,) in W [m].
        params: Distances that make a point part of it.
    """
    above_foot = cloud - p_WO
    height = above_foot[:, 2]
    band = np.flatnonzero((height > -params.carrier_depth) & (height < params.hanging_gap))
    carriers = np.zeros(len(cloud), dtype=bool)
    if len(band):
        labels = cluster_labels(cloud[band], params.hanging_gap)
        carries = np.abs(height[band]) < params.hanging_gap
        carries &= np.linalg.norm(above_foot[band, :2], axis=1) < params.carrier_near
        carriers[band] = np.isin(labels, labels[carries])
    return carriers


def retreat_trajectory(
    travelled: Vector,
    position: Vector,
    velocity: Vector,
    clearances: Callable[[Vector], Vector],
    room: float,
    limits: CommandLimits,
    params: RetreatParams = DEFAULT_RETREAT,
) -> tuple[Vector, float]:
    """Plans a joint trajectory back along the travelled path.

    The arm brakes and returns along the path to the nearest configuration with enough clearance, or
    else to the one with the most clearance.

    Args:
        travelled: (N, 5) configurations of the travelled path, the last nearest to the arm [rad].
        position: Present position of the arm (5,) [rad].
        velocity: Its velocity (5,) [rad/s].
        clearances: Returns the clearances (M,) [m] of postures (M, 5) [rad].
        room: Clearance that is enough [m].
        limits: Limits of the joints.
        params: Durations, braking and strides.

    Returns:
        Joints (N, 5) at even times [rad], and the duration [s].
    """
    back = travelled[::-1]
    along = clearances(back[:: params.stride])
    # An arm that is near an obstacle moves away from it, but not through it.
    nearer = np.minimum.accumulate(along) < min(along[0], room) - params.max_clearance_loss
    if nearer.any():
        along = along[: np.argmax(nearer)]
    enough = np.flatnonzero(along >= room)
    end = int(params.stride * (enough[0] if len(enough) else np.argmax(along)))
    nodes = np.arange(end + 1)
    strongest = limits.acceleration
    # Does not grow with the retreat's duration: slow braking would bring the arm closer.
    braking = params.braking_fraction * strongest
    stopping = float(np.max(_STRONGEST_BRAKING * np.abs(velocity) / braking))
    for duration in params.durations:
        times = np.linspace(0.0, duration, round(duration / params.sample_time) + 1)
        share = minimum_jerk(times / duration)
        path = np.stack(
            [np.interp(share * end, nodes, back[: end + 1, k]) for k in range(5)], axis=1
        )
        path = path + (1.0 - share)[:, None] * (position - back[0])
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
    """Returns displacements (N,) [rad] of braking from 1 rad/s and returning within a duration [s].

    A quintic polynomial of slope one at the start, all other end conditions zero.
    """
    if duration == 0.0:
        return np.zeros_like(times)
    s = np.minimum(times / duration, 1.0)
    return np.asarray(duration * (s - 6 * s**3 + 8 * s**4 - 3 * s**5))
