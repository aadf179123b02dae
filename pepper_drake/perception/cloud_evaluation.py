"""Accuracy of a cloud against the true surfaces of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from scipy.spatial import cKDTree

from pepper_drake.perception.cameras.camera import CameraIntrinsics, pixel_rays, ray_lengths
from pepper_drake.perception.mapping.solids import Solid
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]

COVERED_WITHIN = 0.01
"""A true surface is covered where a point of the cloud is closer than this [m]."""

INCONSISTENT_BEYOND = 0.03
"""A point farther than this from every true surface shows something that does not exist [m]."""

_CHUNK = 500
"""Points whose distances to triangles are computed at a time."""


@dataclass(frozen=True)
class TrueSurfaces:
    """The surfaces of some objects, exactly.

    Attributes:
        solids: Primitives.
        poses: Pose X_WF of each primitive's frame.
        triangles: (T, 3, 3) [m], in W: the corners of all meshes' triangles.
    """

    solids: Sequence[Solid]
    poses: Sequence[RigidTransform]
    triangles: Array

    __repr__ = short_repr

    def closest(self, points: npt.NDArray[np.floating]) -> tuple[Array, Array]:
        """Finds the closest point on any surface.

        Args:
            points: (N, 3) [m], in W.

        Returns:
            The closest points (N, 3) and their distances (N,); infinite without any surface.
        """
        p = np.asarray(points, dtype=float)
        nearest = np.full_like(p, np.nan)
        distance = np.full(len(p), np.inf)
        for solid, X_WF in zip(self.solids, self.poses, strict=True):
            candidate = _closest_on_solid(p, solid, X_WF @ solid.X_FS)
            _keep_closer(p, candidate, nearest, distance)
        if len(self.triangles):
            _keep_closer(p, _closest_on_triangles(p, self.triangles), nearest, distance)
        return nearest, distance

    def distance(self, points: npt.NDArray[np.floating]) -> Array:
        """The distances (N,) that `closest` finds for points (N, 3), sooner."""
        p = np.asarray(points, dtype=float)
        distance = np.full(len(p), np.inf)
        for solid, X_WF in zip(self.solids, self.poses, strict=True):
            p_S = _in_frame(p, X_WF @ solid.X_FS)
            np.minimum(distance, np.abs(solid.signed_distance(p_S)), out=distance)
        if len(self.triangles):
            gap = _closest_on_triangles(p, self.triangles) - p
            np.minimum(distance, np.linalg.norm(gap, axis=1), out=distance)
        return distance


@dataclass(frozen=True)
class CloudReport:
    """Figures of a cloud in `report.json`.

    Attributes:
        points: Their number.
        rms_error: Root mean square distance of the consistent points from the true surfaces [m].
        bias: The shift (x, y, z) of the whole cloud in W that explains its errors best [m].
        coverage: Share of the visible true surface within 1 cm of a point.
        outlier_share: Share of points farther than 3 cm from any true surface.
        robot_points: Points that show the robot's own body.
        goal_points: Points that show the goal object.
    """

    points: int
    rms_error: float
    bias: tuple[float, float, float]
    coverage: float
    outlier_share: float
    robot_points: int
    goal_points: int

    __repr__ = short_repr


def evaluate_cloud(
    points: npt.NDArray[np.floating],
    obstacles: TrueSurfaces,
    visible: npt.NDArray[np.floating],
    robot: TrueSurfaces,
    goal: TrueSurfaces,
) -> CloudReport:
    """Compares a cloud of obstacles with the truth.

    Args:
        points: The cloud (N, 3) [m], in W.
        obstacles: The true surfaces of all obstacles.
        visible: Points (M, 3) spread evenly over what is visible of them.
        robot: The robot's true surfaces.
        goal: The goal object's true surfaces.
    """
    closest, distance = obstacles.closest(points)
    consistent = distance <= INCONSISTENT_BEYOND
    errors = distance[consistent]
    return CloudReport(
        points=len(points),
        rms_error=float(np.sqrt(np.mean(errors**2))) if len(errors) else float("nan"),
        bias=best_shift(np.asarray(points, float)[consistent], closest[consistent]),
        coverage=coverage(points, visible),
        outlier_share=float(np.mean(~consistent)) if len(points) else 0.0,
        robot_points=_count_foreign(points, distance, robot),
        goal_points=_count_foreign(points, distance, goal),
    )


def best_shift(points: Array, closest: Array) -> tuple[float, float, float]:
    """Finds the shift of a cloud that explains its distances from the surfaces best.

    The mean of the error vectors would hide a shift along x that only the few surfaces facing x
    can show. This is the least-squares translation of the point-to-plane distances, as in one step
    of point-to-plane ICP; a direction in which no surface faces gets none.

    Args:
        points: (N, 3) [m].
        closest: The closest point of the true surface to each (N, 3) [m].
    """
    error = points - closest
    length = np.linalg.norm(error, axis=1)
    moved = length > 1e-9
    if not moved.any():
        return (0.0, 0.0, 0.0)
    normals = error[moved] / length[moved, None]
    information = normals.T @ normals
    # A thousandth of the points have to face a direction for a shift along it to be told.
    damping = 1e-3 * len(points) * np.eye(3)
    shift = np.linalg.solve(information + damping, normals.T @ length[moved])
    return (float(shift[0]), float(shift[1]), float(shift[2]))


def coverage(
    points: npt.NDArray[np.floating],
    visible: npt.NDArray[np.floating],
    within: float = COVERED_WITHIN,
) -> float:
    """Returns the share of visible surface points (M, 3) within 1 cm of a cloud's point (N, 3)."""
    if len(visible) == 0:
        return 1.0
    if len(points) == 0:
        return 0.0
    distance, _ = cKDTree(points).query(visible, distance_upper_bound=within)
    return float(np.mean(np.isfinite(distance)))


def visible_surface(
    depth: npt.NDArray[np.floating],
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    shown: npt.NDArray[np.bool_],
    *,
    max_range: float,
    spacing: float = 0.004,
) -> npt.NDArray[np.float32]:
    """Spreads points evenly over the surfaces that a perfect depth image shows.

    Args:
        depth: Perfect depth image (height, width) [m].
        intrinsics: The camera.
        X_WC: Its pose.
        shown: Which pixels count (height, width): those of obstacles.
        max_range: Farthest distance from the camera that counts [m].
        spacing: Distance of the points [m]; where pixels are sparser, there is one for each.

    Returns:
        (M, 3) [m], in W.
    """
    rays = pixel_rays(intrinsics)
    z = np.where(np.isfinite(depth), depth, 0).astype(np.float32)
    reach = z * ray_lengths(intrinsics)
    kept = shown & (reach > 0) & (reach <= max_range)
    p_W = (rays[kept] * z[kept, None]) @ X_WC.rotation().matrix().T + X_WC.translation()
    _, first = np.unique(np.floor(p_W / spacing).astype(np.int64), axis=0, return_index=True)
    return p_W[first].astype(np.float32)


def _count_foreign(
    points: npt.NDArray[np.floating], obstacle_distance: Array, foreign: TrueSurfaces
) -> int:
    """Counts the points that lie on a foreign surface rather than on an obstacle."""
    if len(points) == 0:
        return 0
    distance = foreign.distance(points)
    return int(np.sum((distance < obstacle_distance) & (distance < INCONSISTENT_BEYOND / 2)))


def _keep_closer(p: Array, candidate: Array, nearest: Array, distance: Array) -> None:
    candidate_distance = np.linalg.norm(candidate - p, axis=1)
    closer = candidate_distance < distance
    nearest[closer] = candidate[closer]
    distance[closer] = candidate_distance[closer]


def _closest_on_solid(p_W: Array, solid: Solid, X_WS: RigidTransform) -> Array:
    """Closest points on a primitive: a step down the gradient of its signed distance."""
    p_S = _in_frame(p_W, X_WS)
    step = 1e-6
    gradient = np.stack(
        [
            (solid.signed_distance(p_S + step * e) - solid.signed_distance(p_S - step * e))
            / (2 * step)
            for e in np.eye(3)
        ],
        axis=1,
    )
    closest_S = p_S - solid.signed_distance(p_S)[:, None] * gradient
    return closest_S @ X_WS.rotation().matrix().T + X_WS.translation()


def _in_frame(p_W: Array, X_WS: RigidTransform) -> Array:
    return (p_W - X_WS.translation()) @ X_WS.rotation().matrix()


def _closest_on_triangles(p_W: Array, triangles: Array) -> Array:
    """Closest points (N, 3) on a set of triangles (T, 3, 3); infinite where all are far."""
    best = np.full_like(p_W, np.inf)
    lower, upper = triangles.min(axis=(0, 1)) - 0.1, triangles.max(axis=(0, 1)) + 0.1
    # What is 10 cm away from all of them is inconsistent whatever the exact distance is.
    near = np.flatnonzero(np.all((p_W >= lower) & (p_W <= upper), axis=1))
    middles = triangles.mean(axis=1)
    radii = np.linalg.norm(triangles - middles[:, None], axis=2).max(axis=1)
    tree = cKDTree(middles)
    for chunk in np.split(near, range(_CHUNK, len(near), _CHUNK)) if len(near) else ():
        # The nearest middle is a point of its triangle, so what is farther than that is not asked.
        farthest = np.asarray(tree.query(p_W[chunk])[0])
        found = tree.query_ball_point(p_W[chunk], farthest + radii.max() + 1e-9)
        owner = np.repeat(np.arange(len(chunk)), [len(numbers) for numbers in found])
        number = np.concatenate(found).astype(np.int64)
        gap = np.linalg.norm(p_W[chunk[owner]] - middles[number], axis=1) - radii[number]
        asked = gap <= farthest[owner] + 1e-9
        owner, number = owner[asked], number[asked]
        p = p_W[chunk[owner]]
        candidates = _closest_on_triangle(p, triangles[number])
        order = np.lexsort((np.linalg.norm(candidates - p, axis=1), owner))
        _, first = np.unique(owner[order], return_index=True)
        best[chunk] = candidates[order[first]]
    return best


def _closest_on_triangle(p: Array, triangles: Array) -> Array:
    """Closest points (N, 3) to points (N, 3), each on a triangle of its own (N, 3, 3)."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    closest = np.empty_like(p)
    distance = np.full(len(p), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        along = np.einsum("ni,ni->n", p - start, edge)
        along = np.clip(along / np.maximum(np.einsum("ni,ni->n", edge, edge), 1e-18), 0, 1)
        _keep_closer(p, start + along[:, None] * edge, closest, distance)
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-18)
    foot = p - np.einsum("ni,ni->n", p - a, normal)[:, None] * normal
    inside = np.ones(len(p), dtype=bool)
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("ni,ni->n", foot - start, np.cross(normal, end - start)) >= 0
    closest[inside] = foot[inside]
    return closest
