"""What an arm must not touch, in the torso frame: what was seen, the goal object, and the body."""

from collections.abc import Callable
from functools import cached_property

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics, ArmPoses
from pepper_drake.planning.collision.distance_grid import DistanceGrid, Region, sample
from pepper_drake.planning.collision.exact_distance import ExactDistance
from pepper_drake.planning.collision.self_clearance import self_collision_spheres
from pepper_drake.planning.collision.solid_set import SolidSet
from pepper_drake.planning.collision.sphere_model import SphereModel

Vector = npt.NDArray[np.float64]

GRID_SPACING = 0.02
"""Of the distance grid [m]."""
GRID_CAP = 0.08
"""Distances beyond this are all the same [m]: twice a sphere's radius."""

FAR = 0.15
"""Clearances beyond this do not matter [m]."""

CLOUD, CLOUD_AND_BODY = 0, 1
"""The grid's layers."""


def arm_region(arm: str) -> Region:
    """Where an arm's forearm and hand can be in front of and beside the robot, in T."""
    side = 1.0 if arm == "left" else -1.0
    y = sorted((side * -0.22, side * 0.66))
    return Region.of([-0.20, y[0], -0.50], [0.50, y[1], 0.46], GRID_SPACING)


class ArmCollisionChecker:
    """Distances of an arm to everything around it.

    Args:
        shapes: Of the arm.
        kinematics: Of the arm.
        field: What was seen, in any frame F.
        X_FT: The torso's pose in F.
        object_field: The goal object's surface, in T.
        body_layer: Gives the distance (N,) of the body at the nodes of `arm_region`, m (see
            `sample_body`), if it is asked for.
        body_allowance: How much nearer than obstacles the body may be [m].
    """

    def __init__(
        self,
        shapes: ExactDistance,
        kinematics: ArmKinematics,
        field: PointCloudDistance,
        X_FT: RigidTransform,
        object_field: PointCloudDistance,
        body_layer: Callable[[], Vector],
        body_allowance: float,
    ) -> None:
        self.kinematics, self._shapes = kinematics, shapes
        self._field, self._X_FT, self._object = field, X_FT, object_field
        self._body_layer, self._allowance = body_layer, body_allowance
        self._watched = self_collision_spheres(kinematics.spheres)

    def clearances(self, joints: Vector) -> Vector:
        """Least distance (N,) of the arm at joints (N, 5) to what was seen [m].

        Beyond `FAR` it is infinite.
        """
        return self._shapes.clearances(joints, self._field, self._X_FT, within=FAR)

    def object_clearances(self, joints: Vector) -> Vector:
        """Least distance (N,) of the arm at joints (N, 5) to the goal object, as `clearances`."""
        return self._shapes.clearances(joints, self._object, within=FAR)

    @cached_property
    def _grid(self) -> DistanceGrid:
        region = arm_region(self.kinematics.arm)
        R_FT, p_FT = self._X_FT.rotation().matrix(), self._X_FT.translation()
        seen_T = (self._field.solid_points - p_FT) @ R_FT

        def seen(p_T: Vector) -> Vector:
            return self._field.distance(p_T @ R_FT.T + p_FT, within=GRID_CAP)

        def around_object(p_T: Vector) -> Vector:
            return self._object.distance(p_T, within=GRID_CAP)

        cloud = sample(region, seen, seen_T, GRID_CAP)
        around = sample(region, around_object, self._object.solid_points, GRID_CAP)
        np.minimum(cloud, around, out=cloud)
        with_body = np.minimum(cloud, self._body_layer() + self._allowance)
        return DistanceGrid(region, np.stack((cloud, with_body)))

    @cached_property
    def _moving(self) -> tuple[SphereModel, npt.NDArray[np.intp]]:
        """Elbow, forearm and hand: the upper arm follows them; and each sphere's layer."""
        spheres = self.kinematics.spheres
        kept = np.array([not spheres.link_names[k].endswith("Bicep") for k in spheres.link])
        layers = np.where(self._watched[kept], CLOUD_AND_BODY, CLOUD)
        return spheres.selected(kept), layers

    def approximate_distances(self, joints: Vector) -> npt.NDArray[np.float32]:
        """Distances (S', N) of the spheres below the upper arm, from the grid [m].

        Within a few millimetres of the truth, and at most `GRID_CAP` less the sphere's radius;
        forearm and hand see the body, too, `body_allowance` farther away than it is.
        """
        return self.approximate_distances_and_poses(joints)[0]

    def approximate_distances_and_poses(
        self, joints: Vector
    ) -> tuple[npt.NDArray[np.float32], ArmPoses]:
        """What `approximate_distances` gives, and the poses that it came from."""
        spheres, layers = self._moving
        poses = self.kinematics.poses(joints)
        centers = self.kinematics.sphere_centers(poses, spheres)
        gaps = self._grid.distance(centers, layers[:, None])
        gaps -= spheres.radii.astype(np.float32)[:, None]
        return gaps, poses


def sample_body(arm: str, body: SolidSet) -> Vector:
    """Distance (N,) of the robot's body at the nodes of `arm_region`, at most `GRID_CAP` [m]."""
    return body.distance(arm_region(arm).nodes(), cap=GRID_CAP)
