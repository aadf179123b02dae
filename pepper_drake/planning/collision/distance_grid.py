"""Distances on a grid, for very many look-ups at once."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.planning.collision.compiled_arm import (
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


class DistanceGrid:
    """Distance fields on one region, looked up to first order about the nearest node.

    d(x) = d(n) + grad d(n) · (x - n): where the field is smooth the error is of second order in
    the spacing, at the price of one look-up. A node is measured when it is first looked up: a
    search passes a small part of a region.

    Args:
        region: The nodes.
        layers: (L, N) most that the distances are at the nodes [m], one row a field.
        measure: Gives distances (M,) of places (M, 3) [m], which lower those of all layers; left
            out, the layers are all there is.

    Attributes:
        region: The nodes.
        arrays: What compiled code looks up; missing nodes it hands to `make_ready`.
    """

    def __init__(
        self, region: Region, layers: Vector, measure: Callable[[Vector], Vector] | None = None
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
        """Distances (M, S) [m] at points (M, S, 3); outside the region, those at its border.

        Args:
            points: [m].
            layers: (S,) which field, for each of the S points.

        Raises:
            ValueError: A point is not finite: what is nowhere is not far from everything.
        """
        if not np.isfinite(points).all():
            raise ValueError("points must be finite")
        found, missing = looked_up(points, layers, self.arrays)
        if len(missing):
            self.make_ready(missing)
            found, _ = looked_up(points, layers, self.arrays)
        return np.asarray(found)

    def make_ready(self, nodes: npt.NDArray[np.int64]) -> None:
        """Measures nodes (K,) and their neighbours, for the differences between these."""
        counts, values = self.region.counts, self._values
        if self._measure is not None:
            new = not_measured(nodes, self._measured, self.arrays.counts)
            places = np.stack(np.unravel_index(new, counts), axis=1)
            distances = self._measure(self.region.lower + self.region.spacing * places)
            values[:, new] = np.minimum(values[:, new], distances)
        make_rows(nodes, values, self.arrays)
