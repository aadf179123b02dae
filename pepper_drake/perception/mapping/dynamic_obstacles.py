"""Moving obstacles: points that appear in free space, their velocity and prediction.

A cloud is out of date when the robot reacts to it: by network latency, image period and the arm's
braking time. An obstacle at 0.3 m/s has by then moved by a decimetre. So points that an image shows
in space that an earlier one saw free are clustered, tracked from image to image, and predicted
along their velocity. Near the robot a depth camera is blind: an obstacle that leaves the field of
view there is kept for a while.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace

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
    one_per_voxel,
)

Points = npt.NDArray[np.floating]

_NOWHERE: Points = np.zeros((0, 3), np.float32)
_NARROW = 3
"""Edge of the square of pixels that must all see through a free place [pixels], ..."""
_WIDE = 9
"""... and through a surely free one."""
_REGISTRATIONS = 4
"""Iterations of the registration of a surface with the previous one."""


@dataclass(unsafe_hash=True)
class ApproachParameters:
    """Parameters of tracking moving obstacles.

    Attributes:
        spacing: Spacing of the points kept of an obstacle [m].
        gap: Largest distance of neighbouring points of one obstacle [m].
        min_points: Clusters with fewer points are noise.
        min_remaining_points: Smallest number of points of the rest of an obstacle to guess its
            direction.
        max_speed: Largest speed of an obstacle [m/s].
        horizon: Horizon of the prediction from the image's capture [s]: latency, image period and
            the arm's braking time.
        rest_speed: Speed below which an obstacle counts as at rest, given the measurement noise
            [m/s].
        usual_speed: Smallest speed at which a moving obstacle is predicted [m/s].
        extrapolated: Longest time for which the motion of an unseen obstacle is extrapolated [s].
        memory: Time after its last sighting until an obstacle is dropped [s].
        transient_timeout: Time after the last sighting of any part of an obstacle until its voxels,
            which appeared in free space, are dropped [s].
        contradicted: Fraction of an obstacle's points seen as free at which it is dropped.
        registered_within: Largest median distance of two registered surfaces [m].
        regularization: Weight of zero motion against that of one point, where the shape of a
            surface does not determine the motion.
        comparison_interval: Time between compared images in which slow motion exceeds the noise
            [s].
        max_views: Number of earlier images compared with a new one, besides the last.
        object_fraction: Fraction of a cluster's points at the goal object for it to be the object.
        pointing_error: Largest error of the camera's orientation from one image to another, due to
            slack in the neck and misalignment [rad]: what seems to have come into free space
            because of it is not new. A worn or real robot's is added.
    """

    spacing: float = 0.025
    gap: float = 0.05
    min_points: int = 5
    min_remaining_points: int = 15
    max_speed: float = 0.5
    horizon: float = 0.7
    rest_speed: float = 0.04
    usual_speed: float = 0.25
    extrapolated: float = 1.5
    memory: float = 6.0
    transient_timeout: float = 8.0
    contradicted: float = 0.7
    registered_within: float = 0.02
    regularization: float = 0.02
    comparison_interval: float = 0.5
    max_views: int = 9
    object_fraction: float = 0.5
    pointing_error: float = 0.0

    def with_pointing_error(self, error: float) -> "ApproachParameters":
        """Returns the parameters for a camera with another error [rad] of its orientation."""
        return replace(self, pointing_error=self.pointing_error + error)


@dataclass(frozen=True, eq=False)
class TrackedObstacle:
    """The leading surface of a moving obstacle.

    Attributes:
        points: (N, 3) points that appeared between two images, in W [m].
        velocity: (3,) [m/s]; zero until known.
        seen: Time of the last sighting [s].
    """

    points: Points
    velocity: npt.NDArray[np.float64]
    seen: float

    def moved(self, duration: float) -> Points:
        """Returns the points (N, 3) [m] a duration [s] later, at the same velocity."""
        return self.points + (duration * self.velocity).astype(self.points.dtype)


@dataclass(frozen=True, eq=False)
class DepthFrame:
    """A depth image with its camera pose.

    Attributes:
        depth: (height, width) [m], 0 for holes.
        X_WC: The camera's pose.
        time: Capture time [s].
        intrinsics: The camera.
        pointing_error: Largest error of the camera's orientation relative to other images [rad].
            A place is free if all pixels within it see through the place.
    """

    depth: npt.NDArray[np.float32]
    X_WC: RigidTransform
    time: float
    intrinsics: CameraIntrinsics
    pointing_error: float = 0.0

    @functools.cached_property
    def _clear(self) -> npt.NDArray[np.float32]:
        return self._minimum_depth(_NARROW)

    @functools.cached_property
    def _wide_clear(self) -> npt.NDArray[np.float32]:
        return self._minimum_depth(_WIDE)

    def _minimum_depth(self, least: int) -> npt.NDArray[np.float32]:
        """Returns the least depth in the square of pixels that must see through a free place [m].

        It is zero near the image's border, where what is just outside may have been there.
        """
        focal = max(self.intrinsics.focal_x, self.intrinsics.focal_y)
        error = int(np.ceil(self.pointing_error * focal))
        clear = minimum_depth(self.depth, self.intrinsics, max(2 * error + 1, least))
        if not error:
            return clear
        inside = np.zeros_like(clear)
        inside[error:-error, error:-error] = clear[error:-error, error:-error]
        return inside

    def sees_free_space(
        self, p_W: Points, memory: VoxelMapParameters, *, surely: bool = False
    ) -> npt.NDArray[np.bool_]:
        """Tells which places (N, 3) it sees as free; surely free, if also all around them."""
        clear = self._wide_clear if surely else self._clear
        return is_free_space(p_W, clear, self.intrinsics, self.X_WC, memory)

    def is_like(self, other: "DepthFrame", memory: VoxelMapParameters) -> bool:
        """Tells whether both views show almost the same."""
        relative = self.X_WC.InvertAndCompose(other.X_WC)
        turned = abs(relative.rotation().ToAngleAxis().angle())
        moved = float(np.linalg.norm(relative.translation()))
        return turned < memory.similar_angle and moved < memory.similar_distance


@dataclass(frozen=True, eq=False)
class NewPoints:
    """New points of an image in space that earlier images saw free, and the earlier surface.

    Attributes:
        points: (P, 3) points that appeared, in W [m].
        normals: (P, 3) their unit normals; zero where unknown.
        left: (L, 3) points of the previous image that are not in this one [m].
        since: Capture time of that image [s].
    """

    points: Points
    normals: Points
    left: Points
    since: float

    def part(self, chosen: npt.NDArray[np.int64]) -> "NewPoints":
        """Returns some of the points."""
        return NewPoints(self.points[chosen], self.normals[chosen], self.left, self.since)


def associate(
    things: Sequence[TrackedObstacle],
    come: NewPoints,
    now: DepthFrame,
    memory: VoxelMapParameters,
    parameters: ApproachParameters,
    seen: Points = _NOWHERE,
) -> tuple[TrackedObstacle, ...]:
    """Associates the new points of one image with tracked obstacles.

    Args:
        things: The obstacles tracked so far.
        come: The image's points in space that the previous image saw free.
        now: The image.
        memory: Margins of free space.
        parameters: Parameters of tracking.
        seen: (S, 3) all points of objects in the image, in W [m].

    Returns:
        The tracked obstacles after the image.
    """
    bodies = [seen[chosen] for chosen in _clusters(seen, parameters)] if len(come.points) else []
    thin = one_per_voxel(come.points, 0.5 * parameters.spacing)
    unmatched = list(things)
    known = []
    for chosen in _clusters(come.points[thin], parameters):
        part = come.part(thin[chosen])
        front = part.points
        velocity = estimate_velocity(part, now.time, parameters)
        k = _match(front, unmatched, now.time, parameters)
        if k is not None:
            obstacle = unmatched.pop(k)
            if velocity is None:
                step = front.mean(axis=0) - obstacle.points.mean(axis=0)
                velocity = step.astype(float) / (now.time - obstacle.seen)
            if obstacle.velocity.any():
                weight = len(front) / (len(front) + len(obstacle.points))
                velocity = weight * velocity + (1.0 - weight) * obstacle.velocity
        if velocity is None:
            velocity = _guess_velocity(front, bodies, parameters)
        known.append(TrackedObstacle(front, velocity, now.time))
    for obstacle in unmatched:
        empty = now.sees_free_space(obstacle.points, memory)
        unseen_for = now.time - obstacle.seen
        if unseen_for <= parameters.memory and empty.mean() < parameters.contradicted:
            known.append(obstacle)
    return tuple(known)


def predict_occupancy(
    things: Sequence[TrackedObstacle],
    near: Points,
    now: DepthFrame,
    memory: VoxelMapParameters,
    parameters: ApproachParameters,
) -> npt.NDArray[np.float64]:
    """Predicts the points (Q, 3) at which moving obstacles may soon be, in W [m].

    Obstacles in the last image may enter space that it sees free; those lost from view before are
    not there.

    Args:
        things: Tracked obstacles.
        near: (P, 3) possible positions of obstacles too near to be measured [m].
        now: The last image.
        memory: Margins of free space.
        parameters: Horizon and speeds of the prediction.
    """
    predictions: list[Points] = [near]
    for obstacle in things:
        unseen_for = now.time - obstacle.seen
        speed = float(np.linalg.norm(obstacle.velocity))
        # A motion that has just begun may become faster.
        speedup = max(parameters.usual_speed / speed, 1.0) if speed > parameters.rest_speed else 1.0
        end = speedup * (min(unseen_for, parameters.extrapolated) + parameters.horizon)
        steps = np.linspace(0.0, end, int(np.ceil(speed * end / parameters.spacing)) + 1)
        swept = np.concatenate([obstacle.moved(step) for step in steps])
        swept = swept[one_per_voxel(swept, parameters.spacing)]
        if unseen_for > 0.0:
            swept = swept[~now.sees_free_space(swept, memory)]
        predictions.append(swept)
    soon = np.concatenate(predictions)
    return soon[one_per_voxel(soon, parameters.spacing)].astype(float)


def estimate_velocity(
    front: NewPoints, time: float, parameters: ApproachParameters
) -> npt.NDArray[np.float64] | None:
    """Estimates the velocity of a surface between two images by point-to-plane registration.

    The translation minimizes the distance from the new points to planes at the nearest points that
    were left (Chen and Medioni 1992, doi:10.1016/0262-8856(92)90066-C, without rotation): a surface
    that slides along itself, such as an arm being stretched out, shows its motion only at its end.

    Args:
        front: New points of one obstacle.
        time: Capture time of the image [s].
        parameters: The largest speed.

    Returns:
        (3,) [m/s]; None if the earlier surface was not seen, or does not match.
    """
    middle, duration = front.points.mean(axis=0), time - front.since
    farthest = float(np.linalg.norm(front.points - middle, axis=1).max())
    reach = farthest + parameters.max_speed * duration
    left = front.left[np.sum((front.left - middle) ** 2, axis=1) < reach**2]
    known = front.normals.any(axis=1)
    if len(left) < parameters.min_points or known.sum() < parameters.min_points:
        return None
    tree = cKDTree(left)
    points, normals = front.points[known].astype(float), front.normals[known].astype(float)
    matrix = normals.T @ normals + parameters.regularization * len(normals) * np.eye(3)
    step = np.zeros(3)
    for _ in range(_REGISTRATIONS):
        nearest = tree.query(points - step)[1]
        residual = np.einsum("ij,ij->i", normals, points - left[nearest])
        step = np.linalg.solve(matrix, normals.T @ residual)
    if np.median(tree.query(points - step)[0]) > parameters.registered_within:
        return None
    velocity = step / duration
    speed = float(np.linalg.norm(velocity))
    return np.asarray(velocity * min(1.0, parameters.max_speed / max(speed, 1e-9)))


def _guess_velocity(
    front: Points, bodies: Sequence[Points], parameters: ApproachParameters
) -> npt.NDArray[np.float64]:
    """Guesses the velocity (3,) [m/s] of points seen once: away from the rest of their object.

    Zero if there is no rest.
    """
    tree = cKDTree(front)
    for body in bodies:
        far = np.asarray(tree.query(body)[0])
        rest = body[far > parameters.gap]
        if far.min() <= parameters.gap and len(rest) >= parameters.min_remaining_points:
            ahead = (front.mean(axis=0) - rest.mean(axis=0)).astype(float)
            return np.asarray(parameters.usual_speed * ahead / np.linalg.norm(ahead))
    return np.zeros(3)


def _match(
    front: Points, things: Sequence[TrackedObstacle], time: float, parameters: ApproachParameters
) -> int | None:
    """Returns the index of the obstacle whose prediction is closest to a front, if any is near."""
    middle = front.mean(axis=0)
    best, smallest = None, np.inf
    for number, obstacle in enumerate(things):
        age = time - obstacle.seen
        distance = float(np.linalg.norm(obstacle.moved(age).mean(axis=0) - middle))
        moved = float(np.linalg.norm(obstacle.points.mean(axis=0) - middle))
        if distance < smallest and moved <= parameters.max_speed * age + parameters.gap:
            best, smallest = number, distance
    return best


def last_seen_of_clusters(
    points: Points, times: npt.NDArray[np.float64], parameters: ApproachParameters
) -> npt.NDArray[np.float64]:
    """Returns when any part of each point's object was last seen (N,) [s].

    A hand is still there while its forearm is in view, even if it is inside the near limit.

    Args:
        points: (N, 3) points of objects [m].
        times: Time when each point was last seen (N,) [s].
        parameters: The gap between objects.
    """
    if not len(points):
        return times
    labels = cluster_labels(points, parameters.gap)
    latest = np.full(labels.max() + 1, -np.inf)
    np.maximum.at(latest, labels, times)
    return np.asarray(latest[labels])


def cluster_labels(points: Points, gap: float) -> npt.NDArray[np.int32]:
    """Returns the label (N,) of the cluster that each point belongs to."""
    one, other = cKDTree(points).query_pairs(gap, output_type="ndarray").T
    near = coo_array((np.ones(len(one), np.int8), (one, other)), (len(points), len(points)))
    return np.asarray(connected_components(near, directed=False)[1])


def _clusters(points: Points, parameters: ApproachParameters) -> list[npt.NDArray[np.int64]]:
    """Returns the indices of the points of each cluster that is large enough."""
    if len(points) < parameters.min_points:
        return []
    labels = cluster_labels(points, parameters.gap)
    sizes = np.bincount(labels)
    return [np.flatnonzero(labels == k) for k in np.flatnonzero(sizes >= parameters.min_points)]
