"""Planning scene: arm state, goal pose and obstacles at one moment."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import ControlModel, arm_joints, body_indices
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.perception.mapping.solids import Solid, sample_surface
from pepper_drake.planning.collision.arm_collision_checker import (
    ArmCollisionChecker,
    BodyShapes,
    sample_body,
    swept_head,
)
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.exact_distance import ExactDistance
from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.planning.reach.support_surface import (
    assumed_support,
    extrapolate_support_surface,
)

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PlanningScene:
    """Arm state, goal pose and obstacles at one moment.

    Attributes:
        base_pose: (3,) x, y, yaw in W [m, rad].
        arm: Command from which a movement starts [rad, rad/s].
        X_TO: The goal object's pose.
        cloud_T: (P, 3) observed obstacles near the arm [m].
        checker: Distances of the arm to the obstacles, the goal object and the body.
    """

    base_pose: Vector
    arm: ArmState
    X_TO: RigidTransform
    cloud_T: Vector
    checker: ArmCollisionChecker

    @cached_property
    def field(self) -> PointCloudDistance:
        """Distances to the obstacles that the coupling sees, in T."""
        return PointCloudDistance(self.cloud_T)


class PlanningSceneBuilder:
    """Builds planning scenes from observations.

    Args:
        model: Pepper.
        arm: "left" or "right".
        goal_solids: The goal object's shapes in its frame.
        params: Criteria of a good reach.
    """

    def __init__(
        self,
        model: ControlModel,
        arm: str,
        goal_solids: Sequence[Solid],
        params: ReachPlannerParams,
    ) -> None:
        self._model, self._arm, self._params = model, arm, params
        self._shapes = ExactDistance(model, arm_kinematics(model, arm))
        margin = params.upper_body_clearance - params.hanging_clearance
        self._body = BodyShapes(model, arm, margin)
        self._head_layer = _head_layer(model, arm, margin, -params.self_clearance)
        self._goal_surface = sample_surface(goal_solids)
        self._goal_object = PointCloudDistance(self._goal_surface, extension=0.0)
        self._goal_radius = max((solid.width for solid in goal_solids), default=0.0)
        self._not_in_layer = body_indices((*JOINT_GROUPS["head"], *arm_joints(arm)))
        self._sampled = lru_cache(maxsize=32)(self._sample)
        # One answer asks for the same several times.
        self._torso = lru_cache(maxsize=4)(self._torso_pose)
        self._recent = lru_cache(maxsize=1)(self._build)

    def torso_pose(self, observation: Observation) -> RigidTransform:
        """Returns X_WT of an observation."""
        joints = np.asarray(observation.joint_position, dtype=float)
        return self._torso(joints.tobytes(), tuple(observation.base_pose))

    def _torso_pose(self, joints: bytes, base_pose: tuple[float, ...]) -> RigidTransform:
        context, model = self._model.create_context(), self._model
        positions = model.positions(np.frombuffer(joints), np.array(base_pose))
        model.plant.SetPositions(context, positions)
        return model.pose(context, "torso")

    def goal_surface(self, observation: Observation) -> Vector:
        """Returns points (N, 3) of the goal object's surface in W [m]."""
        X_WO = observation.X_WO
        return self._goal_surface @ X_WO.rotation().matrix().T + X_WO.translation()

    def obstacle_field(self, observation: Observation) -> PointCloudDistance:
        """Returns distances to the cloud and to the unseen part of the support surface, in W.

        Both are assumed to be solid down to `solid_depth`.
        """
        cloud, p_WO = observation.obstacles, observation.p_WO
        params, space = self._params.support_surface, observation.space
        support = extrapolate_support_surface(cloud, p_WO, observation.base_pose, params)
        if space is not None:  # Without cameras all space is known.
            below = assumed_support(cloud, p_WO, self._goal_radius, params)
            support = np.concatenate((support, below))
            # Not where it was seen to be free: an object that was lifted stands on nothing.
            oldest = self._params.unseen.max_age
            support = support[space.unseen(support, observation.time, oldest=oldest)]
        return PointCloudDistance(
            np.concatenate((cloud, support)), extension=self._params.solid_depth
        )

    def __call__(
        self, observation: Observation, field_W: PointCloudDistance | None = None
    ) -> PlanningScene:
        """Returns the planning scene of an observation.

        Args:
            observation: The observation.
            field_W: Distances to obstacles, from `obstacle_field`; for an observation with another
                base pose, that of the original observation.
        """
        return self._recent(observation, field_W)

    def _build(self, observation: Observation, field_W: PointCloudDistance | None) -> PlanningScene:
        field_W = self.obstacle_field(observation) if field_W is None else field_W
        joint_position, base_pose = observation.joint_position, observation.base_pose
        X_WT = self.torso_pose(observation)
        X_TW = X_WT.inverse()
        X_TO = X_TW @ observation.X_WO
        cloud_T = observation.obstacles @ X_TW.rotation().matrix().T + X_TW.translation()
        checker = ArmCollisionChecker(
            self._shapes,
            field_W,
            X_FT=X_WT,
            goal_object=self._goal_object,
            X_TO=X_TO,
            body=lambda: self._body.at(joint_position),
            head=self._body.head,
            body_layer=lambda: self._body_layer(joint_position),
        )
        x, y, z = cloud_T.T
        near = x * x + y * y + z * z < self._params.obstacle_range**2
        return PlanningScene(
            base_pose, observation.arm, X_TO, cloud_T.compress(near, axis=0), checker
        )

    def _body_layer(self, joint_position: Vector) -> npt.NDArray[np.float32]:
        """Returns the body's distances on the grid, with rounded joints.

        The head's are those of all its angles, so that they stay while it looks around.
        """
        rounded = np.round(joint_position / 0.05) * 0.05
        rounded[self._not_in_layer] = 0.0
        return self._sampled(tuple(rounded))

    def _sample(self, joint_position: tuple[float, ...]) -> npt.NDArray[np.float32]:
        body = self._body.at(np.array(joint_position))
        allowance = -self._params.self_clearance
        return np.minimum(sample_body(self._arm, body, allowance), self._head_layer)


@lru_cache(maxsize=4)
def _head_layer(
    model: ControlModel, arm: str, margin: float, allowance: float
) -> npt.NDArray[np.float32]:
    """Returns the distances of the head at all its angles on the grid; see `sample_body`."""
    return sample_body(arm, swept_head(model, margin), allowance)
