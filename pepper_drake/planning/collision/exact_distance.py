"""Distances of an arm's own shapes to a cloud: exact where its spheres bulge out."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit
from pydrake.geometry import Role
from pydrake.math import RigidTransform

from pepper_drake.learning.dmp.point_cells import PointCells, least_gaps
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import ControlModel
from pepper_drake.perception.mapping.solids import Solid, signed_distance
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics

Vector = npt.NDArray[np.float64]

NEAR = 0.03
"""Distances below this are exact; those above are the spheres', which bulge by 14 mm [m]."""


class _Shapes(NamedTuple):
    """An arm's S collision shapes; kinds and dimensions are those of `Solid`.

    Attributes:
        links: (S,) number of the link that each is on.
        kinds: (S,).
        dimensions: (S, 3) [m].
        radii: (S,) of balls around them [m].
        rotations: (S, 3, 3) of each in its link.
        positions: (S, 3) [m].
    """

    links: npt.NDArray[np.int64]
    kinds: npt.NDArray[np.int64]
    dimensions: Vector
    radii: Vector
    rotations: Vector
    positions: Vector


class ExactDistance:
    """An arm's collision shapes.

    The spheres say quickly where an arm is near to something; there the distances of the shapes
    themselves are computed, point by point.

    Args:
        model: Pepper.
        kinematics: Of the arm.

    Attributes:
        kinematics: Of the arm.
    """

    def __init__(self, model: ControlModel, kinematics: ArmKinematics) -> None:
        self.kinematics = kinematics
        inspector = model.diagram.scene_graph().model_inspector()
        links, solids = [], []
        for number, name in enumerate(kinematics.spheres.link_names):
            frame = model.plant.GetBodyFrameIdOrThrow(model.plant.GetBodyByName(name).index())
            for geometry in inspector.GetGeometries(frame, Role.kProximity):
                solid = Solid(inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry))
                links.append(number)
                solids.append(solid)
        self._shapes = _Shapes(
            np.array(links),
            np.array([solid.kind for solid in solids]),
            np.array([solid.dimensions for solid in solids]),
            np.array([solid.bounding_radius for solid in solids]),
            np.array([solid.X_FS.rotation().matrix() for solid in solids]),
            np.array([solid.X_FS.translation() for solid in solids]),
        )

    def distances(
        self,
        joints: Vector,
        field: PointCloudDistance,
        X_FT: RigidTransform | None = None,
        within: float = np.inf,
    ) -> Vector:
        """Least distance (N,) of the arm to the obstacles of a field [m].

        Args:
            joints: (N, 5) rad.
            field: In a frame F.
            X_FT: The torso's pose in F; left out, F is T.
            within: An arm that is farther away than this is infinitely far [m].

        Raises:
            ValueError: A joint is not finite.
        """
        if not np.isfinite(joints).all():
            raise ValueError("joints must be finite")
        if field.cells is None:
            return np.full(len(joints), np.inf)
        X_FT = RigidTransform() if X_FT is None else X_FT
        R_FT, p_FT = X_FT.rotation().matrix(), X_FT.translation()
        poses = self.kinematics.poses(joints)
        centers = self.kinematics.sphere_centers(poses).transpose(2, 1, 0) @ R_FT.T + p_FT
        radii = self.kinematics.spheres.radii
        least: Vector = least_gaps(np.array(centers, order="C"), radii, field.cells, within)
        near = np.flatnonzero(least < NEAR)
        if len(near):
            turned = np.array([np.moveaxis(R[..., near], -1, 0) for R, _ in poses.links])
            moved = np.array([p[:, near].T for _, p in poses.links])
            least[near] = _exact(
                R_FT @ turned, moved @ R_FT.T + p_FT, self._shapes, field.cells, NEAR
            )
        return least


@njit(cache=True)
def _exact(
    rotations: Vector, positions: Vector, shapes: _Shapes, cells: PointCells, most: float
) -> Vector:
    """Least signed distances (M,) of shapes to points, at most `most` [m].

    Args:
        rotations: (L, M, 3, 3) of each link in the frame of the points.
        positions: (L, M, 3) [m].
        shapes: On the links.
        cells: The points.
        most: [m].
    """
    points, first, lower, counts, size = cells
    least = np.full(rotations.shape[1], most)
    low, high = np.empty(3, np.int64), np.empty(3, np.int64)
    R, p = np.empty((3, 3)), np.empty(3)
    for m in range(len(least)):
        for s in range(len(shapes.links)):
            R_L, p_L = rotations[shapes.links[s], m], positions[shapes.links[s], m]
            reach = shapes.radii[s] + least[m]
            for i in range(3):
                p[i] = p_L[i]
                for j in range(3):
                    p[i] += R_L[i, j] * shapes.positions[s, j]
                    R[i, j] = 0.0
                    for k in range(3):
                        R[i, j] += R_L[i, k] * shapes.rotations[s, k, j]
                low[i] = max(math.floor((p[i] - reach - lower[i]) / size), 0)
                high[i] = min(math.floor((p[i] + reach - lower[i]) / size), counts[i] - 1)
            if low[2] > high[2]:
                continue
            for i in range(low[0], high[0] + 1):
                for j in range(low[1], high[1] + 1):
                    row = (i * counts[1] + j) * counts[2]
                    for n in range(first[row + low[2]], first[row + high[2] + 1]):
                        x, y, z = points[n, 0] - p[0], points[n, 1] - p[1], points[n, 2] - p[2]
                        if x * x + y * y + z * z > reach * reach:
                            continue
                        distance = signed_distance(
                            shapes.kinds[s],
                            shapes.dimensions[s],
                            x * R[0, 0] + y * R[1, 0] + z * R[2, 0],
                            x * R[0, 1] + y * R[1, 1] + z * R[2, 1],
                            x * R[0, 2] + y * R[1, 2] + z * R[2, 2],
                        )
                        least[m] = min(least[m], distance)
    return least
