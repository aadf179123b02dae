"""Distances on a grid, for large batches of look-ups."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.planning.collision.compiled_grid import (
    UNKNOWN,
    GridArrays,
    looked_up,
    make_rows,
    not_measured,
)

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Region:
    """A box of grid nodes.

    Attributes:
        lower: (3,) position of the first node [m].
        counts: (3,) number of nodes along each axis.
        spacing: Distance between nodes [m].
    """

    lower: Vector
    counts: tuple[int, int, int]
    spacing: float

    @classmethod
    def of(cls, lower: npt.ArrayLike, upper: npt.ArrayLike, spacing: float) -> "Region":
        """Returns the region that covers a box (3,), (3,) [m]."""
        low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
        n = np.ceil((high - low) / spacing - 1e-9).astype(int) + 1
        return cls(low, (int(n[0]), int(n[1]), int(n[2])), spacing)

    def nodes(self) -> Vector:
        """Returns the positions of the nodes (N, 3), the last coordinate changing fastest [m]."""
        axes = [
            low + self.spacing * np.arange(n)
            for low, n in zip(self.lower, self.counts, strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


class DistanceGrid:
    """Distance fields on one region, to first order about the nearest node.

    d(x) = d(n) + grad d(n) · (x - n): where the field is smooth the error is of second order in
    the spacing, at the cost of one look-up. A node is measured when it is first looked up, since a
    search passes only a small part of a region.

    Args:
        region: The nodes.
        layers: (L, N) upper bounds of the distances at the nodes [m], one row per field.
        measure: Returns distances (M,) of positions (M, 3) [m], common to all layers: the smaller
            of it and the layer's counts. If omitted, the layers are the distances.

    Attributes:
        region: The nodes.
        arrays: The grid for compiled code, which returns missing nodes for `make_ready`.
    """

    def __init__(
        self,
        region: Region,
        layers: npt.NDArray[np.floating],
        measure: Callable[[Vector], Vector] | None = None,
    ) -> None:
        self.region, self._measure = region, measure
        self._values = layers.astype(np.float32)
        self._measured = np.zeros(layers.shape[1], bool)
        self.arrays = GridArrays(
            np.zeros((*layers.shape, 4), dtype=np.float32),
            np.zeros(layers.shape[1], np.uint8),
            np.asarray(region.lower),
            1.0 / region.spacing,
            np.array(region.counts),
        )

    def distance(self, points: Vector, layers: npt.NDArray[np.intp]) -> npt.NDArray[np.float32]:
        """Returns distances (M, S) [m] at points (M, S, 3), clamped to the region.

        Args:
            points: [m].
            layers: (S,) index of the field of each of the S points.

        Raises:
            ValueError: A point is not finite.
        """
        if not np.isfinite(points).all():
            raise ValueError("points must be finite")
        found, missing = looked_up(points, layers, self.arrays)
        if len(missing):
            self.make_ready(missing)
            found, _ = looked_up(points, layers, self.arrays)
        return np.asarray(found)

    def make_ready(self, nodes: npt.NDArray[np.int64]) -> None:
        """Measures nodes (K,), and their neighbours for the differences."""
        grid, values = self.arrays, self._values
        if self._measure is not None:
            new, places = not_measured(
                nodes, self._measured, grid.counts, grid.lower, self.region.spacing
            )
            try:
                distances = self._measure(places)
            except BaseException:  # Interrupted by the user: what was not measured stays unknown.
                self._measured[new] = False
                grid.state[nodes] = UNKNOWN
                raise
            values[:, new] = np.minimum(values[:, new], distances)
        make_rows(nodes, values, grid)
