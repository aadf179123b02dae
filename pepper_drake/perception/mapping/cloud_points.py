"""Conversion between Drake's PointCloud and arrays."""

import numpy as np
import numpy.typing as npt
from pydrake.perception import BaseField, Fields, PointCloud


def cloud_points(cloud: PointCloud) -> npt.NDArray[np.float64]:
    """Returns the finite points (P, 3) of a cloud, in its frame [m]."""
    points = np.asarray(cloud.xyzs(), dtype=float).T
    # The sum of a row is finite if all of it is; faster than `all` along the short axis.
    return points[np.isfinite(points @ np.ones(3))]


def make_cloud(points: npt.NDArray[np.floating]) -> PointCloud:
    """Returns points (P, 3) [m] as a cloud in the same frame."""
    cloud = PointCloud(len(points), Fields(BaseField.kXYZs))
    if len(points):
        cloud.mutable_xyzs()[:] = points.T
    return cloud
