"""Moving obstacles: points that appear in free space, their velocity, their prediction.

A cloud is old when it is acted upon: by the network, the period between images and the time that
an arm needs to brake. An obstacle at 0.3 m/s is by then a decimetre farther on. So points that an
image shows in space that an earlier one saw free are clustered, tracked from image to image, and
predicted along their velocity. Near the robot a depth camera is blind: an obstacle that leaves the
view there is kept for a while.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.mapping.voxel_map import (
    VoxelMapParameters,
    is_free_space,
    minimum_depth,
    voxel_keys,
)

Points = npt.NDArray[np.floating]

_NOWHERE: Points = np.zeros((0, 3), np.float32)
_WIDE = 9
"""Edge of the square of pixels that have to look through a place surely."""
_REGISTRATIONS = 4
"""Steps in which a surface is registered with what it was."""


@dataclass(unsafe_hash=True)
class ApproachParameters:
    """Parameters of tracking moving obstacles.

    Attributes:
        spacing: Of the points that are kept of an obstacle [m].
        gap: Points of one obstacle have neighbours nearer than this [m].
        least_points: Clusters of fewer points are noise.
        least_rest: Fewer points of an obstacle's rest do not tell its direction.
        fastest: Largest speed of an obstacle [m/s].
        horizon: Time from the image to which motion is predicted [s]: the age at which the image is
            acted upon, the period, and the time in which an arm brakes.
        slowest: Speed below which an obstacle counts as standing, for the measurement's noise
            [m/s].
        usual_speed: A moving obstacle is predicted at no less than this [m/s].
        extrapolated: Longest time for which the motion of an unseen obstacle is extrapolated [s].
        memory: Time after its last sighting until an obstacle is dropped [s].
        transient_timeout: Time after the last sighting of any part of an obstacle until its voxels,
            which appeared in free space, are dropped [s].
        contradicted: An obstacle is dropped if an image sees this share of its points as free.
        registered_within: Largest median distance of two surfaces that are the same [m].
        regularization: Weight of zero motion against that of one point, where the shape of a
            surface does not determine the motion.
        comparison_interval: Time between compared images in which slow motion exceeds the noise
            [s].
        most_views: Number of earlier images that a new one is compared with, besides the last.
        object_share: A cluster with this share of its points at the goal object is the object.
    """

    spacing: float = 0.025
    gap: float = 0.05
    least_points: int = 5
    least_rest: int = 15
    fastest: float = 0.5
    horizon: float = 0.7
    slowest: float = 0.04
    usual_speed: float = 0.25
    extrapolated: float = 1.5
    memory: float = 6.0
    transient_timeout: float = 8.0
    contradicted: float = 0.7
    registered_within: float = 0.02
    regularization: float = 0.02
    comparison_interval: float = 0.5
    most_views: int = 9
    object_share: float = 0.5


@dataclass(frozen=True, eq=False)
class TrackedObstacle:
    """The front of something that moves.

    Attributes:
        points: (N, 3) where it came between two images, in W [m].
        velocity: (3,) m/s; zero until it is known.
        seen: When it was seen last [s].
    """

    points: Points
    velocity: npt.NDArray[np.float64]
    seen: float

    def moved(self, duration: float) -> Points:
        """Points (N, 3) [m] a duration [s] later, at the same velocity."""
        return self.points + (duration * self.velocity).astype(self.points.dtype)


@dataclass(frozen=True, eq=False)
class DepthFrame:
    """A depth image with where it was taken.

    Attributes:
        depth: (height, width), m, 0 where nothing was measured.
        X_WC: The camera's pose.
        time: s.
        intrinsics: The camera.
    """

    depth: npt.NDArray[np.float32]
    X_WC: RigidTransform
    time: float
    intrinsics: CameraIntrinsics

    @functools.cached_property
    def _clear(self) -> npt.NDArray[np.float32]:
        return minimum_depth(self.depth, self.intrinsics)

    @functools.cached_property
    def _wide_clear(self) -> npt.NDArray[np.float32]:
        return minimum_depth(self.depth, self.intrinsics, _WIDE)

    def sees_free_space(
        self, p_W: Points, memory: VoxelMapParameters, *, surely: bool = False
    ) -> npt.NDArray[np.bool_]:
        """Which places (N, 3) it looks through; surely, if also all around them."""
        clear = self._wide_clear if surely else self._clear
        return is_free_space(p_W, clear, self.intrinsics, self.X_WC, memory)

    def is_like(self, other: "DepthFrame", memory: VoxelMapParameters) -> bool:
        """True if both views show almost the same, by the parameters of a memory of them."""
        off = self.X_WC.InvertAndCompose(other.X_WC)
        turned = abs(off.rotation().ToAngleAxis().angle())
        moved = float(np.linalg.norm(off.translation()))
        return turned < memory.alike_angle and moved < memory.alike_distance


@dataclass(frozen=True, eq=False)
class NewPoints:
    """New points of an image in space that earlier images saw free, and the earlier surface.

    Attributes:
        points: (P, 3) that appeared, in W [m].
        normals: (P, 3) of its surface, of unit length; zero where unknown.
        left: (L, 3) of the image before that are not in this one [m].
        since: When that image was taken [s].
    """

    points: Points
    normals: Points
    left: Points
    since: float

    def part(self, chosen: npt.NDArray[np.int64]) -> "NewPoints":
        """Some of the points."""
        return NewPoints(self.points[chosen], self.normals[chosen], self.left, self.since)


def associate(
    things: Sequence[TrackedObstacle],
    come: NewPoints,
    now: DepthFrame,
    memory: VoxelMapParameters,
    parameters: ApproachParameters,
    seen: Points = _NOWHERE,
) -> tuple[TrackedObstacle, ...]:
    """Takes one image into what is known of things that move.

    Args:
        things: What was known before.
        come: What the image shows where the one before it looked through.
        now: The image.
        memory: Margins at which an image counts as looking through a place.
        parameters: How things are followed.
        seen: (S, 3) all that the image shows of things, in W [m].

    Returns:
        The tracked obstacles after the image.
    """
    bodies = [seen[chosen] for chosen in _clusters(seen, parameters)] if len(come.points) else []
    thin = _thinned(come.points, 0.5 * parameters.spacing)
    left = list(things)
    known = []
    for chosen in _clusters(come.points[thin], parameters):
        part = come.part(thin[chosen])
        front = part.points
        velocity = estimate_velocity(part, now.time, parameters)
        k = _same(front, left, now.time, parameters)
        if k is not None:
            thing = left.pop(k)
            if velocity is None:
                step = front.mean(axis=0) - thing.points.mean(axis=0)
                velocity = step.astype(float) / (now.time - thing.seen)
            if thing.velocity.any():
                share = len(front) / (len(front) + len(thing.points))
                velocity = share * velocity + (1.0 - share) * thing.velocity
        if velocity is None:
            velocity = _guess_velocity(front, bodies, parameters)
        known.append(TrackedObstacle(front, velocity, now.time))
    for thing in left:
        empty = now.sees_free_space(thing.points, memory)
        lost = now.time - thing.seen
        if lost <= parameters.memory and empty.mean() < parameters.contradicted:
            known.append(thing)
    return tuple(known)


def predict_occupancy(
    things: Sequence[TrackedObstacle],
    near: Points,
    now: DepthFrame,
    memory: VoxelMapParameters,
    parameters: ApproachParameters,
) -> npt.NDArray[np.float64]:
    """Points (Q, 3) at which moving obstacles may be soon, in W [m].

    Obstacles in the last image may enter space that it sees free; those that were lost from sight
    before are not there.

    Args:
        things: Tracked obstacles.
        near: (P, 3) where something too near to be measured may be now [m].
        now: The last image.
        memory: Margins at which an image counts as looking through a place.
        parameters: Horizon and speeds of the prediction.
    """
    ways: list[Points] = [near]
    for thing in things:
        lost = now.time - thing.seen
        speed = float(np.linalg.norm(thing.velocity))
        # A motion that begins may become faster.
        haste = max(parameters.usual_speed / speed, 1.0) if speed > parameters.slowest else 1.0
        end = haste * (min(lost, parameters.extrapolated) + parameters.horizon)
        steps = np.linspace(0.0, end, int(np.ceil(speed * end / parameters.spacing)) + 1)
        way = np.concatenate([thing.moved(step) for step in steps])
        way = way[_thinned(way, parameters.spacing)]
        if lost > 0.0:
            way = way[~now.sees_free_space(way, memory)]
        ways.append(way)
    soon = np.concatenate(ways)
    return soon[_thinned(soon, parameters.spacing)].astype(float)


def estimate_velocity(
    front: NewPoints, time: float, parameters: ApproachParameters
) -> npt.NDArray[np.float64] | None:
    """Velocity of a surface between two images, by point-to-plane registration.

    The step between is that of least distance from the new points to planes at the nearest
    points that were left (point-to-plane registration, Chen and Medioni 1992,
    doi:10.1016/0262-8856(92)90066-C, without rotation): what slides along itself, as an arm does
    that is stretched out, shows its motion at its end alone.

    Args:
        front: New points of one obstacle.
        time: Of the image [s].
        parameters: The largest speed.

    Returns:
        (3,) m/s; None if the earlier surface was not seen, or does not fit.
    """
    middle, duration = front.points.mean(axis=0), time - front.since
    farthest = float(np.linalg.norm(front.points - middle, axis=1).max())
    reach = farthest + parameters.fastest * duration
    left = front.left[np.sum((front.left - middle) ** 2, axis=1) < reach**2]
    known = front.normals.any(axis=1)
    if len(left) < parameters.least_points or known.sum() < parameters.least_points:
        return None
    tree = cKDTree(left)
    points, normals = front.points[known].astype(float), front.normals[known].astype(float)
    matrix = normals.T @ normals + parameters.regularization * len(normals) * np.eye(3)
    step = np.zeros(3)
    for _ in range(_REGISTRATIONS):
        nearest = tree.query(points - step)[1]
        off = np.einsum("ij,ij->i", normals, points - left[nearest])
        step = np.linalg.solve(matrix, normals.T @ off)
    if np.median(tree.query(points - step)[0]) > parameters.registered_within:
        return None
    velocity = step / duration
    speed = float(np.linalg.norm(velocity))
    return np.asarray(velocity * min(1.0, parameters.fastest / max(speed, 1e-9)))


def _guess_velocity(
    front: Points, bodies: Sequence[Points], parameters: ApproachParameters
) -> npt.NDArray[np.float64]:
    """Velocity guess (3,) [m/s] of points that were seen once: away from the rest of their object.

    Zero if there is no rest.
    """
    tree = cKDTree(front)
    for body in bodies:
        far = np.asarray(tree.query(body)[0])
        rest = body[far > parameters.gap]
        if far.min() <= parameters.gap and len(rest) >= parameters.least_rest:
            ahead = (front.mean(axis=0) - rest.mean(axis=0)).astype(float)
            return np.asarray(parameters.usual_speed * ahead / np.linalg.norm(ahead))
    return np.zeros(3)


def _same(
    front: Points, things: Sequence[TrackedObstacle], time: float, parameters: ApproachParameters
) -> int | None:
    """Which of the things a front belongs to: the nearest to where it should be, if one is near."""
    middle = front.mean(axis=0)
    best, least = None, np.inf
    for number, thing in enumerate(things):
        age = time - thing.seen
        off = float(np.linalg.norm(thing.moved(age).mean(axis=0) - middle))
        moved = float(np.linalg.norm(thing.points.mean(axis=0) - middle))
        if off < least and moved <= parameters.fastest * age + parameters.gap:
            best, least = number, off
    return best


def _thinned(points: Points, spacing: float) -> npt.NDArray[np.int64]:
    """The index of one point of each voxel of that size."""
    return np.asarray(np.unique(voxel_keys(points, spacing), return_index=True)[1])


def last_seen_of_things(
    points: Points, times: npt.NDArray[np.float64], parameters: ApproachParameters
) -> npt.NDArray[np.float64]:
    """When each point's thing was last seen, whichever part of it that was (N,) [s].

    A hand whose forearm is in view has not gone, though a camera is blind for what is near to it.

    Args:
        points: (N, 3) of things [m].
        times: When each was last seen itself (N,) [s].
        parameters: The gap between things.
    """
    if not len(points):
        return times
    labels = thing_labels(points, parameters.gap)
    latest = np.full(labels.max() + 1, -np.inf)
    np.maximum.at(latest, labels, times)
    return np.asarray(latest[labels])


def thing_labels(points: Points, gap: float) -> npt.NDArray[np.int32]:
    """The number (N,) of the thing that each point belongs to."""
    one, other = cKDTree(points).query_pairs(gap, output_type="ndarray").T
    near = coo_array((np.ones(len(one), np.int8), (one, other)), (len(points), len(points)))
    return np.asarray(connected_components(near, directed=False)[1])


def _clusters(points: Points, parameters: ApproachParameters) -> list[npt.NDArray[np.int64]]:
    """The indices of the points of each thing, without those of too few."""
    if len(points) < parameters.least_points:
        return []
    labels = thing_labels(points, parameters.gap)
    sizes = np.bincount(labels)
    return [np.flatnonzero(labels == k) for k in np.flatnonzero(sizes >= parameters.least_points)]
