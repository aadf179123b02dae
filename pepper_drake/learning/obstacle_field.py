"""Distance to what a point cloud shows, and the direction away from it."""

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pepper_drake.errors import InputError

Array = npt.NDArray[np.float64]

EXTENSION = 0.12
"""How far points are extended downwards [m]: what stands on something is solid below its top."""

_SPACING = 0.02
_NEIGHBOURS = 12
_BLENDING = 0.006


class ObstacleField:
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
        """Builds the k-d tree.

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
        self.points = cloud[np.isfinite(cloud).all(axis=1)]
        depths = np.linspace(0.0, extension, round(extension / _SPACING) + 1)
        columns = self.points + np.multiply.outer(depths, np.asarray(down, dtype=float))[:, None]
        self._solid = columns.reshape(-1, 3)
        self._tree = (
            cKDTree(self._solid, balanced_tree=False, compact_nodes=False)
            if len(self._solid)
            else None
        )
        self._neighbours = min(_NEIGHBOURS, len(self._solid))

    def distance(self, positions: npt.ArrayLike) -> Array:
        """Returns the distance (...) [m] of positions (..., 3); infinite for an empty cloud."""
        positions = np.asarray(positions, dtype=float)
        if self._tree is None:
            return np.full(positions.shape[:-1], np.inf)
        return np.asarray(self._tree.query(positions)[0])

    def distance_and_normal(self, positions: npt.ArrayLike) -> tuple[Array, Array]:
        """Returns distances (...) [m] and unit normals (..., 3), which point away from obstacles.

        For an empty cloud distances are infinite and normals zero.
        """
        positions = np.asarray(positions, dtype=float)
        if self._tree is None:
            return np.full(positions.shape[:-1], np.inf), np.zeros(positions.shape)
        count = self._neighbours
        found, indices = self._tree.query(positions, k=range(1, count + 1))
        distances = np.asarray(found)
        nearest = distances[..., :1]
        away = positions[..., None, :] - self._solid[indices]
        weights = np.exp((nearest - distances) / _BLENDING) / np.maximum(distances, 1e-9)
        blended = (weights[..., None, :] @ away)[..., 0, :]
        size = np.sqrt((blended * blended).sum(axis=-1))[..., None]
        # Directions may cancel out inside a solid: there the nearest point alone decides.
        blended = np.where(size > 1e-9, blended, away[..., 0, :])
        size = np.maximum(np.sqrt((blended * blended).sum(axis=-1))[..., None], 1e-12)
        return nearest[..., 0], blended / size
