"""What an arm must not touch, in the torso frame: what was seen, the goal object, and the body."""

from collections.abc import Callable
from functools import cached_property

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.learning.obstacle_field import ObstacleField
from pepper_drake.planning.arm_kinematics import ArmKinematics, ArmPoses
from pepper_drake.planning.arm_spheres import LinkSpheres
from pepper_drake.planning.distance_grid import DistanceGrid, Region, sample
from pepper_drake.planning.placed_solids import PlacedSolids
from pepper_drake.planning.self_clearance import watched_spheres

Vector = npt.NDArray[np.float64]

GRID_SPACING = 0.02
"""Of the distance grid, m."""
GRID_CAP = 0.08
"""Distances beyond this are all the same, m: twice a sphere's radius."""

CLOUD, CLOUD_AND_BODY = 0, 1
"""The grid's layers."""


def arm_region(arm: str) -> Region:
    """Where an arm's forearm and hand can be in front of and beside the robot, in T."""
    side = 1.0 if arm == "left" else -1.0
    y = sorted((side * -0.22, side * 0.66))
    return Region.of([-0.20, y[0], -0.50], [0.50, y[1], 0.46], GRID_SPACING)


class Surroundings:
    """Distances of an arm's spheres to everything around it.

    Args:
        kinematics: Of the arm.
        field: What was seen, in any frame F.
        X_FT: The torso's pose in F.
        object_solids: The goal object in T.
        body_layer: Gives the distance (N,) of the body at the nodes of `arm_region`, m (see
            `sample_body`), if it is asked for.
        body_allowance: How much nearer than obstacles the body may be, m.
    """

    def __init__(
        self,
        kinematics: ArmKinematics,
        field: ObstacleField,
        X_FT: RigidTransform,
        object_solids: PlacedSolids,
        body_layer: Callable[[], Vector],
        body_allowance: float,
    ) -> None:
        self.kinematics = kinematics
        self._field, self._object = field, object_solids
        self._R_FT, self._p_FT = X_FT.rotation().matrix(), X_FT.translation()
        self._body_layer, self._allowance = body_layer, body_allowance
        self._watched = watched_spheres(kinematics.spheres)

    def seen_distance(self, points: Vector) -> Vector:
        """Distances (...) of points (..., 3) in T to what was seen, m."""
        return self._field.distance(points @ self._R_FT.T + self._p_FT)

    def clearances(self, joints: Vector) -> Vector:
        """Least distance (N,) of the arm's spheres at joints (N, 5) to what was seen, m."""
        centers, radii = self._centers(joints, self.kinematics.spheres)
        return (self.seen_distance(centers) - radii).min(axis=0)

    def gaps(self, joints: Vector) -> Vector:
        """Distances (S, N) of the arm's spheres to what was seen and the goal object, m."""
        return self._gaps(joints, self.kinematics.spheres)

    def hand_gaps(self, joints: Vector) -> Vector:
        """Distances (S', N) as of `gaps`, of the spheres below the upper arm."""
        return self._gaps(joints, self._moving[0])

    def _gaps(self, joints: Vector, spheres: LinkSpheres) -> Vector:
        centers, radii = self._centers(joints, spheres)
        distance = self.seen_distance(centers)
        if len(self._object):
            distance = np.minimum(distance, self._object.distance(centers, cap=0.2))
        return distance - radii

    def _centers(self, joints: Vector, spheres: LinkSpheres) -> tuple[Vector, Vector]:
        """Centres (S, N, 3) in T and radii (S, 1) of spheres, m."""
        poses = self.kinematics.poses(joints)
        centers = self.kinematics.sphere_centers(poses, spheres).transpose(1, 2, 0)
        return centers, spheres.radii[:, None]

    @cached_property
    def _grid(self) -> DistanceGrid:
        region = arm_region(self.kinematics.arm)
        seen_T = (self._field.solid_points - self._p_FT) @ self._R_FT
        cloud = sample(region, self.seen_distance, seen_T, GRID_CAP)
        if len(self._object):
            nodes = region.nodes()
            cloud = np.minimum(cloud, self._object.distance(nodes, cap=GRID_CAP))
        return DistanceGrid(
            region, np.stack((cloud, np.minimum(cloud, self._body_layer() + self._allowance)))
        )

    @cached_property
    def _moving(self) -> tuple[LinkSpheres, npt.NDArray[np.intp]]:
        """Elbow, forearm and hand: the upper arm follows them; and each sphere's layer."""
        spheres = self.kinematics.spheres
        kept = np.array([not spheres.link_names[k].endswith("Bicep") for k in spheres.link])
        layers = np.where(self._watched[kept], CLOUD_AND_BODY, CLOUD)
        return spheres.selected(kept), layers

    def quick_gaps(self, joints: Vector) -> Vector:
        """Distances (S', N) of the spheres below the upper arm, from the grid, m.

        Within a few millimetres of the truth, and at most `GRID_CAP` less the sphere's radius;
        forearm and hand see the body, too, `body_allowance` farther away than it is.
        """
        return self.quick_gaps_and_poses(joints)[0]

    def quick_gaps_and_poses(self, joints: Vector) -> tuple[Vector, ArmPoses]:
        """What `quick_gaps` gives, and the poses that it came from."""
        spheres, layers = self._moving
        poses = self.kinematics.poses(joints)
        centers = self.kinematics.sphere_centers(poses, spheres)
        gaps = self._grid.distance(centers, layers[:, None])
        gaps -= spheres.radii.astype(np.float32)[:, None]
        return gaps, poses


def sample_body(arm: str, body: PlacedSolids) -> Vector:
    """Distance (N,) of the robot's body at the nodes of `arm_region`, at most `GRID_CAP`, m."""
    return body.distance(arm_region(arm).nodes(), cap=GRID_CAP)
