"""Distances on a grid, for very many look-ups at once."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.compiled import compiled

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Region:
    """A box of grid nodes.

    Attributes:
        lower: (3,) the first node [m].
        counts: (3,) number of nodes a side.
        spacing: Between nodes [m].
    """

    lower: Vector
    counts: tuple[int, int, int]
    spacing: float

    @classmethod
    def of(cls, lower: npt.ArrayLike, upper: npt.ArrayLike, spacing: float) -> "Region":
        """The region that covers a box (3,), (3,) [m]."""
        low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
        n = np.ceil((high - low) / spacing - 1e-9).astype(int) + 1
        return cls(low, (int(n[0]), int(n[1]), int(n[2])), spacing)

    def nodes(self) -> Vector:
        """The nodes (N, 3), the last coordinate changing fastest [m]."""
        axes = [
            low + self.spacing * np.arange(n)
            for low, n in zip(self.lower, self.counts, strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def sample(region: Region, points: Vector, cap: float) -> Vector:
    """Distances (N,) [m] of the nodes of a region to the nearest of some points, at most `cap`.

    Args:
        region: The nodes.
        points: (P, 3) [m].
        cap: Greatest distance of interest [m].
    """
    squares = np.full(region.counts, cap * cap)
    _lower_squares(squares, np.array(region.lower), region.spacing, np.array(points), cap)
    return np.sqrt(squares).ravel()


@compiled
def _lower_squares(
    squares: Vector, lower: Vector, spacing: float, points: Vector, cap: float
) -> None:
    """Lowers squared distances (I, J, K) of nodes to those of points (P, 3) within a cap."""
    first, last = np.empty(3, np.int64), np.empty(3, np.int64)
    z = np.empty(squares.shape[2])
    for n in range(len(points)):
        for k in range(3):
            place = (points[n, k] - lower[k]) / spacing
            reach = cap / spacing
            first[k] = max(math.ceil(place - reach), 0)
            last[k] = min(math.floor(place + reach), squares.shape[k] - 1)
        for k in range(first[2], last[2] + 1):
            z[k] = (lower[2] + spacing * k - points[n, 2]) ** 2
        for i in range(first[0], last[0] + 1):
            x = (lower[0] + spacing * i - points[n, 0]) ** 2
            for j in range(first[1], last[1] + 1):
                xy = x + (lower[1] + spacing * j - points[n, 1]) ** 2
                if xy < cap * cap:
                    for k in range(first[2], last[2] + 1):
                        squares[i, j, k] = min(squares[i, j, k], xy + z[k])


class DistanceGrid:
    """Distance fields on one region, looked up to first order about the nearest node.

    d(x) = d(n) + grad d(n) · (x - n): where the field is smooth the error is of second order in
    the spacing, at the price of one look-up.

    Args:
        region: The nodes.
        layers: (L, N) distances at the nodes [m], one row a field.
    """

    def __init__(self, region: Region, layers: Vector) -> None:
        self.region = region
        shape = (len(layers), *region.counts)
        table = np.empty((*shape, 4), dtype=np.float32)
        table[..., 0] = layers.reshape(shape)
        for axis in range(3):
            # Central differences, per spacing; one-sided ones at the border.
            d = np.moveaxis(table[..., 0], axis + 1, -1)
            g = np.moveaxis(table[..., axis + 1], axis + 1, -1)
            g[..., 1:-1] = 0.5 * (d[..., 2:] - d[..., :-2])
            g[..., 0] = d[..., 1] - d[..., 0]
            g[..., -1] = d[..., -1] - d[..., -2]
        self._table = table.reshape(-1, 4)
        self._size = int(np.prod(region.counts))
        self._strides = np.array(
            [region.counts[1] * region.counts[2], region.counts[2], 1], dtype=np.int32
        )

    def distance(
        self, points: Vector, layer: npt.NDArray[np.intp] | int = 0
    ) -> npt.NDArray[np.float32]:
        """Distances (...) [m] at points (3, ...); outside the region, those at its border.

        Args:
            points: [m].
            layer: Which field, a number or an array that broadcasts against (...).
        """
        region = self.region
        index = np.asarray(layer, dtype=np.int32) * np.int32(self._size)
        offsets = []
        for k in range(3):
            scaled = (points[k] - region.lower[k]).astype(np.float32)
            scaled *= np.float32(1.0 / region.spacing)
            np.clip(scaled, 0, region.counts[k] - 1, out=scaled)
            nearest = np.rint(scaled)
            index = index + nearest.astype(np.int32) * self._strides[k]
            scaled -= nearest
            offsets.append(scaled)
        rows = self._table.take(index.ravel(), axis=0).reshape(*index.shape, 4)
        distance = rows[..., 0].copy()
        for k in range(3):
            distance += rows[..., k + 1] * offsets[k]
        return distance
