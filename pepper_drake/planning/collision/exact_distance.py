"""Distances of an arm's own shapes to a cloud: exact where its spheres bulge out."""

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.learning.dmp.point_cells import minimum_gaps
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import ControlModel
from pepper_drake.perception.mapping.solids import (
    Solid,
    SolidArrays,
    SolidSet,
    collision_solids,
    minimum_link_distances,
    sample_surface,
)
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics
from pepper_drake.planning.collision.sphere_model import SphereModel

Vector = npt.NDArray[np.float64]

NEAR = 0.03
"""Distances below this are exact; those above are the spheres', which bulge by 14 mm [m]."""
_SPACING = 0.008
"""Spacing of the points on the arm's surface: an edge between two of them is 2 mm nearer [m]."""


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
        plant, scene_graph = model.plant, model.diagram.scene_graph()
        links: list[int] = []
        solids: list[Solid] = []
        for number, name in enumerate(kinematics.spheres.link_names):
            own = collision_solids(plant, scene_graph, plant.GetBodyByName(name).index())
            links += [number] * len(own)
            solids += own
        self._links, self._solids = np.array(links), SolidArrays.of(solids)
        self._surface = _surface(kinematics.spheres.link_names, links, solids)

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
        poses = self.kinematics.poses(joints, X_FT)
        centers = self.kinematics.sphere_centers(poses)
        least: Vector = minimum_gaps(centers, self.kinematics.spheres.radii, field.cells, within)
        near = np.flatnonzero(least < NEAR)
        if len(near):
            least[near] = minimum_link_distances(
                poses.rotations[near],
                poses.positions[near],
                self._links,
                self._solids,
                field.cells,
                NEAR,
            )
        return least

    def surface_points(self, joints: Vector) -> Vector:
        """Returns points (N, P, 3) on forearm and hand in T [m], 8 mm apart, at joints (N, 5)."""
        return self.kinematics.sphere_centers(self.kinematics.poses(joints), self._surface)


def can_reach_body(link_name: str) -> bool:
    """Tells whether a link can reach the body; those nearer to the shoulder touch it by design."""
    return link_name.endswith(("ForeArm", "wrist"))


def _surface(names: tuple[str, ...], links: list[int], solids: list[Solid]) -> SphereModel:
    """Returns the points of the outer surface of the links that can reach the body."""
    link, points = [np.zeros(0, dtype=np.intp)], [np.zeros((0, 3))]
    for number, name in enumerate(names):
        own = [solid for k, solid in zip(links, solids, strict=True) if k == number]
        if can_reach_body(name):
            on = sample_surface(own, _SPACING)
            on = on[SolidSet(own).distance(on) > -1e-6]
            points.append(on)
            link.append(np.full(len(on), number))
    centers = np.concatenate(points)
    return SphereModel(names, np.concatenate(link), centers, np.zeros(len(centers)))
