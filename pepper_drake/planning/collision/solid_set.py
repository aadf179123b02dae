"""Distances to solids that stand in one frame."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Box, Cylinder, Shape
from pydrake.math import RigidTransform

from pepper_drake.perception.mapping.solids import Solid

Vector = npt.NDArray[np.float64]


class SolidSet:
    """Solids at fixed poses in a frame F.

    Args:
        solids: Shapes (Box, Cylinder, Sphere or Capsule) and their poses X_FS.
    """

    def __init__(self, solids: Sequence[tuple[Shape, RigidTransform]]) -> None:
        self._solids = [Solid(shape, pose) for shape, pose in solids]

    def __len__(self) -> int:
        """Number of solids."""
        return len(self._solids)

    def distance(self, positions: Vector, cap: float = np.inf) -> Vector:
        """Signed distance (...) [m] of positions (..., 3) to the nearest solid, at most `cap`.

        With a cap only what is near a solid costs anything.
        """
        points = positions.reshape(-1, 3)
        least = np.full(len(points), cap)
        for solid in self._solids:
            X_SF = solid.X_FS.inverse()
            chosen: npt.NDArray[np.intp] | slice = slice(None)
            if np.isfinite(cap):
                offset = points - solid.X_FS.translation()
                reach = solid.bounding_radius + cap
                chosen = np.flatnonzero(np.einsum("ij,ij->i", offset, offset) <= reach**2)
            p_S = points[chosen] @ X_SF.rotation().matrix().T + X_SF.translation()
            least[chosen] = np.minimum(least[chosen], solid.signed_distance(p_S))
        return least.reshape(positions.shape[:-1])


def sample_surface(solids: Sequence[Solid], spacing: float = 0.01) -> Vector:
    """Points (P, 3) on the surfaces of boxes and cylinders, in the frame in which they are placed.

    Args:
        solids: Boxes and cylinders with their poses X_FS.
        spacing: Between points at most [m].
    """
    points = [np.zeros((0, 3))]
    for solid in solids:
        shape = solid.shape
        if isinstance(shape, Cylinder):
            turns = int(np.ceil(2.0 * np.pi * shape.radius() / spacing))
            angle = 2.0 * np.pi * np.arange(turns) / turns
            rim = shape.radius() * np.stack((np.cos(angle), np.sin(angle)), axis=1)
            rings = np.concatenate([rim * r for r in _even(0.0, 1.0, spacing / shape.radius())])
            half = shape.length() / 2.0
            side = [_at_height(rim, z) for z in _even(-half, half, spacing)]
            local = np.concatenate([*side, _at_height(rings, -half), _at_height(rings, half)])
        elif isinstance(shape, Box):
            half_size = np.asarray(shape.size()) / 2.0
            axes = [_even(-h, h, spacing) for h in half_size]
            nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
            local = nodes[np.any(np.abs(nodes) >= half_size - 1e-9, axis=1)]
        else:
            raise TypeError(f"no points on a shape of type {type(shape).__name__}")
        points.append(local @ solid.X_FS.rotation().matrix().T + solid.X_FS.translation())
    return np.concatenate(points)


def _even(lower: float, upper: float, spacing: float) -> Vector:
    """Even numbers from one to another, no farther apart than the spacing."""
    return np.linspace(lower, upper, int(np.ceil((upper - lower) / spacing)) + 1)


def _at_height(points: Vector, z: float) -> Vector:
    """Points (N, 2) in the plane at a height, (N, 3)."""
    return np.column_stack((points, np.full(len(points), z)))
