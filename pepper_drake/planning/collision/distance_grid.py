"""Distances on a grid, for very many look-ups at once."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter

Vector = npt.NDArray[np.float64]
Field = Callable[[Vector], Vector]
"""Distances (N,) [m] at points (N, 3)."""


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


def near_nodes(region: Region, points: Vector, reach: float) -> npt.NDArray[np.bool_]:
    """Which nodes (N,) may be within `reach` [m] of some points (P, 3): all that are, and more.

    Points are counted in cells of the size of the reach; the nodes of a cell are near if it or
    one of its neighbours holds a point.
    """
    size = np.asarray(region.counts)
    per_cell = int(np.ceil(reach / region.spacing))
    cells = (size - 1) // per_cell + 3  # One cell of border, for points just outside.
    index = np.floor((points - region.lower) / (per_cell * region.spacing)).astype(int) + 1
    inside = np.all((index >= 0) & (index < cells), axis=1)
    occupied = np.zeros(cells, dtype=bool)
    occupied[tuple(index[inside].T)] = True
    occupied = maximum_filter(occupied, size=3, mode="constant")[1:-1, 1:-1, 1:-1]
    for axis, n in enumerate(size):
        occupied = np.repeat(occupied, per_cell, axis=axis).take(np.arange(n), axis=axis)
    return occupied.ravel()


def sample(region: Region, field: Field, points: Vector | None, cap: float) -> Vector:
    """Distances (N,) [m] at the nodes of a region, at most `cap`.

    Args:
        region: The nodes.
        field: Gives the distances.
        points: (P, 3) on the surfaces that the field is about: nodes far from all of them are not
            asked for. None asks for all.
        cap: Greatest distance of interest [m].
    """
    values = np.full(int(np.prod(region.counts)), cap)
    nodes = region.nodes()
    chosen = (
        np.ones(len(nodes), dtype=bool)
        if points is None
        else near_nodes(region, points, cap)
        if len(points)
        else np.zeros(len(nodes), dtype=bool)
    )
    if chosen.any():
        values[chosen] = np.minimum(field(nodes[chosen]), cap)
    return values


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
