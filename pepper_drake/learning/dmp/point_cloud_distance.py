"""Distance to a point cloud, and the direction away from it."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.dmp.point_cells import (
    PointCells,
    blended_directions,
    nearest_distances,
)

Array = npt.NDArray[np.float64]

EXTENSION = 0.12
"""Downward extension [m] of points: a standing object is solid below its top."""

_SPACING = 0.02
_NEIGHBOURS = 12
_ONES = np.ones(3)
_BLENDING = 0.006


class PointCloudDistance:
    """Distances to a cloud whose points are extended straight down.

    A depth camera sees a thin shell, and a hand that starts below a table's top would as readily be
    pushed under it as over it; the extension makes the shell solid. The normal is the mean of the
    directions from the 12 nearest points, weighted by exp(-(d_i - d_1) / 6 mm), so that it turns
    smoothly from one point to the next.

    Attributes:
        points: (P, 3) the cloud's finite points [m].
    """

    def __init__(
        self,
        points: npt.ArrayLike,
        extension: float = EXTENSION,
        down: npt.ArrayLike = (0.0, 0.0, -1.0),
    ) -> None:
        """Stores the points; they are sorted into cells at the first query.

        Args:
            points: (P, 3) [m]; P may be zero.
            extension: How far to extend each point [m]; zero leaves the shell.
            down: (3,) unit vector, in the frame of the points.

        Raises:
            InputError: The points are not (P, 3).
        """
        cloud = np.asarray(points, dtype=float)
        if cloud.size == 0:
            cloud = np.zeros((0, 3))
        if cloud.ndim != 2 or cloud.shape[1] != 3:
            raise InputError(f"obstacles: shape {cloud.shape}; give points of shape (P, 3)")
        self.points = cloud.compress(np.isfinite(cloud @ _ONES), axis=0)
        depths = np.linspace(0.0, extension, round(extension / _SPACING) + 1)
        self._offsets = np.multiply.outer(depths, np.asarray(down, dtype=float))
        self._neighbours = min(_NEIGHBOURS, len(self.points) * len(depths))

    @cached_property
    def cells(self) -> PointCells:
        """The extended cloud, sorted into cells."""
        return PointCells.of(self.points, self._offsets)

    def distance(self, positions: npt.ArrayLike, within: float = np.inf) -> Array:
        """Returns the distance (...) [m] of positions (..., 3); infinite for an empty cloud.

        Args:
            positions: [m].
            within: Distances beyond this [m] are returned as infinite, which is much faster.
        """
        places = _finite(positions)
        found = nearest_distances(places.reshape(-1, 3), self.cells, float(within))
        return np.asarray(found.reshape(places.shape[:-1]))

    def distance_and_normal(self, positions: npt.ArrayLike) -> tuple[Any, Array]:
        """Returns distances (...) [m] and unit normals (..., 3), which point away from obstacles.

        For an empty cloud distances are infinite and normals zero.
        """
        places = _finite(positions)
        if not len(self.points):
            return np.full(places.shape[:-1], np.inf), np.zeros(places.shape)
        distances, normals = blended_directions(
            places.reshape(-1, 3), self.cells, self._neighbours, _BLENDING
        )
        return distances.reshape(places.shape[:-1])[()], normals.reshape(places.shape)


def _finite(positions: npt.ArrayLike) -> Array:
    """Returns a copy of positions (..., 3) for compiled code.

    Raises:
        ValueError: A number is not finite: an unknown position is not far from everything.
    """
    places = np.array(positions, dtype=float, order="C")
    if not np.isfinite(places).all():
        raise ValueError("positions must be finite")
    return places
