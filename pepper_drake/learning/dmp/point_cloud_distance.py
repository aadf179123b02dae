"""Distance to what a point cloud shows, and the direction away from it."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pepper_drake.errors import InputError

Array = npt.NDArray[np.float64]

EXTENSION = 0.12
"""Downward extension [m] of points: an object that stands is solid below its top."""

_SPACING = 0.02
_NEIGHBOURS = 12
_LEAF = 64
"""Points in a leaf of the tree: few questions are asked of each tree, so it has to be made fast."""
_ONES = np.ones(3)
_BLENDING = 0.006


class PointCloudDistance:
    """Distances to a cloud whose points are extended straight down.

    A depth camera sees a thin shell, and a hand that starts below a table's top would be pushed
    under it as readily as over it; the extension makes the shell solid. The normal is the mean of
    the directions from the 12 nearest points, weighted by exp(-(d_i - d_1) / 6 mm), so that it
    turns smoothly from one point to the next.

    Attributes:
        points: (P, 3) the cloud, without points that are not finite [m].
    """

    def __init__(
        self,
        points: npt.ArrayLike,
        extension: float = EXTENSION,
        down: npt.ArrayLike = (0.0, 0.0, -1.0),
    ) -> None:
        """Keeps the points; the k-d tree is built with the first question.

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
        self.points = cloud[np.isfinite(cloud @ _ONES)]
        depths = np.linspace(0.0, extension, round(extension / _SPACING) + 1)
        columns = self.points + np.multiply.outer(depths, np.asarray(down, dtype=float))[:, None]
        self._solid = columns.reshape(-1, 3)
        self._neighbours = min(_NEIGHBOURS, len(self._solid))

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._solid, _LEAF, balanced_tree=False, compact_nodes=False)

    @property
    def solid_points(self) -> Array:
        """(Q, 3) the cloud and what it was extended by [m]."""
        return self._solid

    def distance(self, positions: npt.ArrayLike, within: float = np.inf) -> Array:
        """Returns the distance (...) [m] of positions (..., 3); infinite for an empty cloud.

        Args:
            positions: [m].
            within: Beyond this distance [m] it is infinite as well, which is much faster to say.
        """
        positions = np.asarray(positions, dtype=float)
        if not len(self._solid):
            return np.full(positions.shape[:-1], np.inf)
        return np.asarray(self._tree.query(positions, distance_upper_bound=within)[0])

    def distance_and_normal(self, positions: npt.ArrayLike) -> tuple[Any, Array]:
        """Returns distances (...) [m] and unit normals (..., 3), which point away from obstacles.

        For an empty cloud distances are infinite and normals zero.
        """
        positions = np.asarray(positions, dtype=float)
        if not len(self._solid):
            return np.full(positions.shape[:-1], np.inf), np.zeros(positions.shape)
        indices = self._tree.query(positions, k=range(1, self._neighbours + 1))[1]
        away = positions[..., None, :] - self._solid[indices]
        if positions.ndim == 1:
            return _blended_one(away, squared_norm(away))
        return _blended(away, squared_norm(away))

    def points_within(self, positions: Array, radius: float) -> list[Array]:
        """Returns for each position (N, 3) the points (K, 3) of the solid within a radius [m]."""
        if not len(self._solid):
            return [self._solid] * len(positions)
        return [self._solid[i] for i in self._tree.query_ball_point(positions, radius)]


def _blended_one(away: Array, squares: Array) -> tuple[float, Array]:
    """Does what `_blended` does, for one hand and with less overhead."""
    if len(squares) == 0:
        return math.inf, np.zeros(3)
    distances = np.sqrt(squares)
    nearest = min(distances.tolist())  # Of a dozen numbers, faster than an array's own.
    if nearest > 1e-9:
        blended = (np.exp((nearest - distances) / _BLENDING) / distances) @ away
        size = math.sqrt(blended.dot(blended))
        if size > 1e-9:
            return nearest, blended / size
    return nearest, _blended(away, squares)[1]


def _blended(away: Array, squares: Array) -> tuple[Array, Array]:
    """Returns the least length (...) and the blended direction (..., 3) of vectors (..., K, 3).

    Args:
        away: (..., K, 3), K may be zero.
        squares: (..., K) their squared lengths.
    """
    if squares.shape[-1] == 0:
        return np.full(squares.shape[:-1], np.inf), np.zeros((*away.shape[:-2], 3))
    distances = np.sqrt(squares)
    nearest = distances.min(axis=-1)
    weights = np.exp((nearest[..., None] - distances) / _BLENDING) / np.maximum(distances, 1e-9)
    blended = (weights[..., None, :] @ away)[..., 0, :]
    size = np.sqrt(squared_norm(blended))
    if size.min() <= 1e-9:
        # Directions may cancel out inside a solid: there the nearest point alone decides.
        first = np.argmin(distances, axis=-1)
        alone = np.take_along_axis(away, first[..., None, None], axis=-2)[..., 0, :]
        blended = np.where((size > 1e-9)[..., None], blended, alone)
        size = np.maximum(np.sqrt(squared_norm(blended)), 1e-12)
    return nearest, blended / size[..., None]


def squared_norm(vectors: Array) -> Array:
    """Returns the squared length (...) of vectors (..., 3)."""
    return np.einsum("...i,...i->...", vectors, vectors)
