"""Accuracy of a cloud against the true surfaces of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.geometry import GeometryInstance, ProximityProperties, SceneGraph, Shape
from pydrake.math import RigidTransform
from scipy.spatial import cKDTree

from pepper_drake.perception.cameras.camera import CameraIntrinsics, pixel_rays, ray_lengths
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]

COVERED_WITHIN = 0.01
"""A true surface is covered where a point of the cloud is closer than this [m]."""

INCONSISTENT_BEYOND = 0.03
"""A point farther than this from every true surface is an outlier [m]."""

_FARTHEST = 0.1
"""Largest distance to a surface that is computed [m]: points beyond are outliers anyway."""


class TrueSurfaces:
    """The exact surfaces of some shapes."""

    def __init__(self, shapes: Sequence[tuple[Shape, RigidTransform]]) -> None:
        """Makes the surfaces.

        Args:
            shapes: The shapes, each with its pose in W.
        """
        self._scene_graph = SceneGraph()
        source = self._scene_graph.RegisterSource("truth")
        for number, (shape, X_WS) in enumerate(shapes):
            surface = GeometryInstance(X_WS, shape, f"surface {number}")
            surface.set_proximity_properties(ProximityProperties())
            self._scene_graph.RegisterAnchoredGeometry(source, surface)
        self._context = self._scene_graph.CreateDefaultContext()

    def closest(self, points: npt.NDArray[np.floating]) -> tuple[Array, Array]:
        """Finds the closest point on any surface.

        Args:
            points: (N, 3) [m], in W.

        Returns:
            The closest points (N, 3), and their distances (N,): NaN and infinite where all surfaces
            are farther than 10 cm.
        """
        query = self._scene_graph.get_query_output_port().Eval(self._context)
        nearest, distance = np.full((len(points), 3), np.nan), np.full(len(points), np.inf)
        for k, p_WQ in enumerate(np.asarray(points, dtype=float)):
            for found in query.ComputeSignedDistanceToPoint(p_WQ, _FARTHEST):
                if abs(found.distance) < distance[k]:
                    distance[k] = abs(found.distance)
                    nearest[k] = query.GetPoseInWorld(found.id_G) @ found.p_GN
        return nearest, distance


@dataclass(frozen=True)
class CloudReport:
    """Metrics of a cloud in `report.json`.

    Attributes:
        points: Number of points.
        rms_error: Root mean square distance of the inliers from the true surfaces [m].
        bias: The translation (x, y, z) of the whole cloud in W that best explains its errors [m].
        coverage: Fraction of the visible true surface within 1 cm of a point.
        outlier_share: Fraction of points farther than 3 cm from any true surface.
        robot_points: Number of points on the robot's own body.
        goal_points: Number of points on the goal object.
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
    """Compares a cloud of obstacles with the ground truth.

    Args:
        points: The cloud (N, 3) [m], in W.
        obstacles: The true surfaces of all obstacles.
        visible: Points (M, 3) spread evenly over their visible part.
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
    """Finds the translation of a cloud that best explains its distances from the surfaces.

    The mean of the error vectors would hide a shift along x, which only the few surfaces facing x
    reveal. This is the least-squares translation of the point-to-plane distances, as in one step
    of point-to-plane ICP; it is zero in directions that no surface faces.

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
    # A shift is determined only along directions that a thousandth of the points face.
    damping = 1e-3 * len(points) * np.eye(3)
    shift = np.linalg.solve(information + damping, normals.T @ length[moved])
    return (float(shift[0]), float(shift[1]), float(shift[2]))


def coverage(
    points: npt.NDArray[np.floating],
    visible: npt.NDArray[np.floating],
    within: float = COVERED_WITHIN,
) -> float:
    """Returns the fraction of visible surface points (M, 3) within 1 cm of a cloud (N, 3)."""
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
    """Samples the surfaces in a perfect depth image evenly.

    Args:
        depth: Perfect depth image (height, width) [m].
        intrinsics: The camera.
        X_WC: Its pose.
        shown: Mask of the pixels of obstacles (height, width).
        max_range: Largest distance from the camera that counts [m].
        spacing: Spacing of the points [m]; one per pixel where pixels are sparser.

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
    """Counts the points that are closer to a foreign surface than to an obstacle."""
    if len(points) == 0:
        return 0
    distance = foreign.closest(points)[1]
    return int(np.sum((distance < obstacle_distance) & (distance < INCONSISTENT_BEYOND / 2)))
