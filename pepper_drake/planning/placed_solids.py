"""Distances to solids that stand in one frame."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Shape
from pydrake.math import RigidTransform

from pepper_drake.perception.solids import Solid

Vector = npt.NDArray[np.float64]


class PlacedSolids:
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
