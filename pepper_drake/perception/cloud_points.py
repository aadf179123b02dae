"""Drake's PointCloud as an array."""

import numpy as np
import numpy.typing as npt
from pydrake.perception import PointCloud


def cloud_points(cloud: PointCloud) -> npt.NDArray[np.float64]:
    """Returns the finite points (P, 3) of a cloud, in its frame, m."""
    points = np.asarray(cloud.xyzs(), dtype=float).T
    return points[np.isfinite(points).all(axis=1)]
