"""Distances on a grid, for large batches of look-ups."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.planning.collision.compiled_grid import GridArrays, PlacedCloud, looked_up

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
        region: The nodes, in T.
        layers: (L, N) upper bounds of the distances at the nodes [m], one row per field.
        clouds: Clouds that lower the distances of all layers, at least one, each in a frame F, with
            X_FT.
        cap: Distance up to which a cloud is measured [m].

    Attributes:
        region: The nodes.
        arrays: The grid for compiled code, which measures on its way.
    """

    def __init__(
        self,
        region: Region,
        layers: npt.NDArray[np.floating],
        clouds: Sequence[tuple[PointCloudDistance, RigidTransform]],
        cap: float,
    ) -> None:
        self.region = region
        self.arrays = GridArrays(
            np.empty((*layers.shape, 4), dtype=np.float32),
            np.zeros(layers.shape[1], bool),
            layers.astype(np.float32),
            np.zeros(layers.shape[1], bool),
            np.asarray(region.lower),
            region.spacing,
            np.array(region.counts),
            tuple(
                PlacedCloud(
                    cloud.cells, np.array(X_FT.rotation().matrix(), order="C"), X_FT.translation()
                )
                for cloud, X_FT in clouds
            ),
            cap,
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
        return looked_up(points, layers, self.arrays)
