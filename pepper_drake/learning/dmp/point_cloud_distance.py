"""Distance to what a point cloud shows, and the direction away from it."""

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
_REMEMBERED = 80
_ONES = np.ones(3)
_WITHOUT_TREE = 10
"""Times that all points can be looked at in the time that it takes to build a tree."""
_VICINITY = 0.2
"""Points this far around a hand are looked at first, without a tree [m]."""
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
        """Keeps the points; the k-d tree is built when it pays.

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
        self._looked_at = 0
        self._center, self._vicinity = np.full(3, np.inf), self._solid[:0]

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self._solid, balanced_tree=False, compact_nodes=False)

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
        if positions.ndim == 1 and not self._has_tree():
            nearest = squared_norm(positions - self.nearest(positions, 1)[0][0])
            return np.asarray(math.sqrt(nearest) if nearest < within**2 else np.inf)
        return np.asarray(self._tree.query(positions, distance_upper_bound=within)[0])

    def distance_and_normal(self, positions: npt.ArrayLike) -> tuple[Any, Array]:
        """Returns distances (...) [m] and unit normals (..., 3), which point away from obstacles.

        For an empty cloud distances are infinite and normals zero.
        """
        positions = np.asarray(positions, dtype=float)
        if not len(self._solid):
            return np.full(positions.shape[:-1], np.inf), np.zeros(positions.shape)
        if positions.ndim == 1:
            away = positions - self.nearest(positions, _NEIGHBOURS)[0]
            return _blended_one(away, squared_norm(away))
        indices = self._tree.query(positions, k=range(1, self._neighbours + 1))[1]
        away = positions[..., None, :] - self._solid[indices]
        return _blended(away, squared_norm(away))

    def points_within(self, positions: Array, radius: float) -> list[Array]:
        """Returns for each position (N, 3) the points (K, 3) of the solid within a radius [m]."""
        if not len(self._solid):
            return [self._solid] * len(positions)
        return [self._solid[i] for i in self._tree.query_ball_point(positions, radius)]

    def _has_tree(self) -> bool:
        """True if a k-d tree exists, or pays by now."""
        return "_tree" in self.__dict__ or self._looked_at > _WITHOUT_TREE * len(self._solid)

    def follow(self) -> "FieldFollower":
        """Returns a view of the field that is faster for one hand that moves in small steps."""
        return FieldFollower(self)

    def nearest(self, position: Array, count: int) -> tuple[Array, float]:
        """Returns the (K, 3) points of the solid nearest to a position (3,), K <= count.

        All others are at least as far as the second value [m], infinite where there are none.
        """
        size = len(self._solid)
        if count < size and self._has_tree():
            distances, indices = self._tree.query(position, k=count)
            return self._solid[indices], float(np.max(distances))
        if count >= size:
            return self._solid[np.argsort(squared_norm(position - self._solid))], np.inf
        moved = position - self._center
        safe = _VICINITY - math.sqrt(moved.dot(moved))
        if safe > 0.0 and len(self._vicinity) > count:
            points, farthest, _ = self._nearest_of(self._vicinity, position, count)
            if farthest < safe:
                return points, farthest
        points, farthest, squares = self._nearest_of(self._solid, position, count)
        self._center = position.copy()
        self._vicinity = self._solid[squares < _VICINITY**2]
        return points, farthest

    def _nearest_of(self, points: Array, position: Array, count: int) -> tuple[Array, float, Array]:
        """The nearest of more points (N, 3), the farthest of them, all squared distances (N,)."""
        self._looked_at += len(points)
        away = position - points
        squares = (away * away) @ _ONES
        chosen = squares.argpartition(count)[:count]
        chosen = chosen[squares[chosen].argsort()]
        return points[chosen], math.sqrt(squares[chosen[-1]]), squares


class FieldFollower:
    """Gives what `PointCloudDistance.distance_and_normal` gives, along the way of one hand.

    It keeps the points around the last position that it looked up, and asks the k-d tree again
    only when the hand has moved so far that another point could be among the nearest.
    """

    def __init__(self, field: PointCloudDistance) -> None:
        """Starts without knowing anything."""
        self._field = field
        self._anchor = np.full(3, np.inf)
        self._points = np.zeros((0, 3))
        self._radius = -np.inf

    @property
    def points(self) -> Array:
        """(P, 3) the cloud [m]."""
        return self._field.points

    def distance(self, positions: npt.ArrayLike, within: float = np.inf) -> Array:
        """Returns what `PointCloudDistance.distance` gives."""
        positions = np.asarray(positions, dtype=float)
        if positions.ndim > 1:
            return self._field.distance(positions, within)
        distance = self.distance_and_normal(positions)[0]
        return np.asarray(distance if distance < within else np.inf)

    def distance_and_normal(self, position: Array) -> tuple[float, Array]:
        """Returns distance [m] and unit normal (3,) at a position (3,)."""
        moved = position - self._anchor
        slack = self._radius - math.sqrt(moved.dot(moved))
        if slack > 0.0:
            away = position - self._points
            squares = (away * away) @ _ONES
            if len(squares) > _NEIGHBOURS:
                chosen = squares.argpartition(_NEIGHBOURS - 1)[:_NEIGHBOURS]
                away, squares = away[chosen], squares[chosen]
                farthest = squares[-1]
            else:
                farthest = squares.max(initial=0.0)
            if farthest <= slack * slack:
                return _blended_one(away, squares)
        self._points, self._radius = self._field.nearest(position, _REMEMBERED)
        self._anchor = position
        away = position - self._points[:_NEIGHBOURS]
        # Summed as above: the last bit must not tell how long the follower has followed.
        return _blended_one(away, (away * away) @ _ONES)


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
