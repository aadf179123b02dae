"""What a reach is played through in: the arm, the goal object, and what is around them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import ControlModel, arm_joints, body_indices
from pepper_drake.perception.mapping.solids import Solid
from pepper_drake.planning.collision.arm_collision_checker import ArmCollisionChecker, sample_body
from pepper_drake.planning.collision.arm_geometry import ArmGeometry
from pepper_drake.planning.collision.self_clearance import SelfClearance
from pepper_drake.planning.collision.solid_set import sample_surface
from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.reach.reach_plan import ReachPlannerParams
from pepper_drake.planning.reach.support_surface import extrapolate_support_surface

Vector = npt.NDArray[np.float64]

_NEAR = 1.0
"""What is farther from the torso's frame than this cannot be touched [m]."""


@dataclass(frozen=True, eq=False)
class PlanningScene:
    """What a reach is played through in.

    Attributes:
        base_pose: (3,) x, y, yaw in W.
        arm: Where the arm is.
        X_TO: The goal object's pose.
        body: A context of the model's plant with the body's joints.
        cloud_T: (P, 3) what was seen near the arm [m].
        surroundings: The same and all else that the arm must not touch.
    """

    base_pose: Vector
    arm: ArmState
    X_TO: RigidTransform
    body: Context
    cloud_T: Vector
    surroundings: ArmCollisionChecker

    @cached_property
    def field(self) -> PointCloudDistance:
        """What the coupling knows of obstacles, in T."""
        return PointCloudDistance(self.cloud_T)


class PlanningSceneBuilder:
    """Makes situations of what was seen.

    Args:
        model: Pepper.
        geometry: Of the arm.
        self_clearance: Of the arm to the body.
        goal_solids: The goal object's shapes in its frame.
        params: What counts as good.
    """

    def __init__(
        self,
        model: ControlModel,
        geometry: ArmGeometry,
        self_clearance: SelfClearance,
        goal_solids: Sequence[Solid],
        params: ReachPlannerParams,
    ) -> None:
        self._model, self._geometry, self._params = model, geometry, params
        self._arm, self._self_clearance = geometry.arm, self_clearance
        self._object_points = sample_surface(goal_solids)
        self._arm_in_body = body_indices(arm_joints(geometry.arm))
        self._body_layers: dict[tuple[float, ...], Vector] = {}

    def with_extrapolated_surface(
        self, cloud_W: Vector, X_WO: RigidTransform, base_pose: Vector
    ) -> PointCloudDistance:
        """What was seen and what is supposed to be there as well, solid as it is taken to be."""
        beside = extrapolate_support_surface(cloud_W, X_WO.translation(), base_pose)
        return PointCloudDistance(
            np.concatenate((cloud_W, beside)), extension=self._params.solid_depth
        )

    def __call__(
        self,
        base_pose: Vector,
        joint_position: Vector,
        X_WO: RigidTransform,
        cloud_W: Vector,
        field_W: PointCloudDistance,
        arm_velocity: Vector | None = None,
    ) -> PlanningScene:
        """What a reach from a place is played through in.

        Args:
            base_pose: (3,) the place, x, y, yaw in W.
            joint_position: (15,) rad.
            X_WO: The goal object's pose.
            cloud_W: (P, 3) what was seen [m].
            field_W: The same with what is supposed, of `with_extrapolated_surface`.
            arm_velocity: (5,) of the arm's commands [rad/s]; left out, it is at rest.
        """
        context = self._model.create_context()
        self._model.plant.SetPositions(context, self._model.positions(joint_position, base_pose))
        X_WT = self._model.pose(context, "torso")
        X_TW = X_WT.inverse()
        X_TO = X_TW @ X_WO
        cloud_T = cloud_W @ X_TW.rotation().matrix().T + X_TW.translation()
        object_T = self._object_points @ X_TO.rotation().matrix().T + X_TO.translation()
        surroundings = ArmCollisionChecker(
            self._geometry.shapes,
            self._geometry.kinematics,
            field_W,
            X_WT,
            PointCloudDistance(object_T, extension=0.0),
            lambda: self._body_layer(joint_position),
            -self._params.self_clearance,
        )
        return PlanningScene(
            base_pose,
            ArmState(
                joint_position[self._arm_in_body],
                np.zeros(5) if arm_velocity is None else arm_velocity,
            ),
            X_TO,
            context,
            cloud_T[np.linalg.norm(cloud_T, axis=1) < _NEAR],
            surroundings,
        )

    def _body_layer(self, joint_position: Vector) -> Vector:
        """Distances of the body on the grid, for its joints rounded and its head straight."""
        rounded = np.round(joint_position / 0.05) * 0.05
        rounded[body_indices(["HeadYaw", "HeadPitch"])] = 0.0
        rounded[self._arm_in_body] = 0.0
        key = tuple(rounded)
        if key not in self._body_layers:
            context = self._model.create_context()
            q = self._model.positions(rounded, np.zeros(3))
            self._model.plant.SetPositions(context, q)
            self._body_layers[key] = sample_body(self._arm, self._self_clearance.body(context))
        return self._body_layers[key]
