"""Distances of an arm's own shapes to a cloud: exact where its spheres bulge out."""

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Role
from pydrake.math import RigidTransform

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import ControlModel
from pepper_drake.perception.mapping.solids import Solid
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics, ArmPoses

Vector = npt.NDArray[np.float64]

NEAR = 0.03
"""Distances below this are exact; those above are the spheres', which bulge by 14 mm [m]."""


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
        self._shapes: list[tuple[int, Solid]] = []
        for number, name in enumerate(kinematics.spheres.link_names):
            frame = model.plant.GetBodyFrameIdOrThrow(model.plant.GetBodyByName(name).index())
            for geometry in inspector.GetGeometries(frame, Role.kProximity):
                solid = Solid(inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry))
                self._shapes.append((number, solid))

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
        """
        X_FT = RigidTransform() if X_FT is None else X_FT
        R_FT, p_FT = X_FT.rotation().matrix(), X_FT.translation()
        kinematics = self.kinematics
        poses = kinematics.poses(joints)
        centers = kinematics.sphere_centers(poses).transpose(1, 2, 0) @ R_FT.T + p_FT
        radii = kinematics.spheres.radii[:, None]
        reach = within + float(radii.max())
        least = (field.distance(centers, within=reach) - radii).min(axis=0)
        near = np.flatnonzero(least < NEAR)
        if len(near):
            least[near] = self._exact(poses, near, field, R_FT, p_FT)
        return least

    def _exact(
        self,
        poses: ArmPoses,
        chosen: npt.NDArray[np.intp],
        field: PointCloudDistance,
        R_FT: Vector,
        p_FT: Vector,
    ) -> Vector:
        """Least signed distances of the shapes at some of the poses, at most `NEAR`."""
        least = np.full(len(chosen), NEAR)
        for link, solid in self._shapes:
            R, p = (part[..., chosen] for part in poses.links[link])
            X_LS = solid.X_FS
            R_FS = np.einsum("ai,ijm,jk->mak", R_FT, R, X_LS.rotation().matrix())
            p_TS = np.einsum("ijm,j->mi", R, X_LS.translation()) + p.T
            p_FS = p_TS @ R_FT.T + p_FT
            nearby = field.points_within(p_FS, solid.bounding_radius + NEAR)
            for m, points in enumerate(nearby):
                if len(points):
                    distances = solid.signed_distance((points - p_FS[m]) @ R_FS[m])
                    least[m] = min(least[m], distances.min())
        return least
