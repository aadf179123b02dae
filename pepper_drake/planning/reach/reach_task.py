"""Task of a reach: the arm, its goal on the object, and the limits of its motion."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from pydrake.math import RigidTransform

from pepper_drake.learning.dmp.obstacle_coupling import Coupling
from pepper_drake.models.control_model import ControlModel
from pepper_drake.models.scene import Scene
from pepper_drake.perception.goal.detection import MarkedObject
from pepper_drake.perception.mapping.solids import Solid
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.planning.trajectories.adaptation_params import GoalAxis


@dataclass(frozen=True, eq=False)
class ReachTask:
    """Input of a reach planner besides the movement.

    Attributes:
        model: Pepper.
        arm: "left" or "right".
        X_OG: The hand's pre-grasp pose in the goal object's frame.
        coupling: Obstacle coupling; None for no obstacle avoidance.
        ik: Parameters of the inverse kinematics.
        params: Criteria of a good reach.
        image_period: Time between depth images [s].
        goal_solids: The goal object's shapes in its frame: adapted movements keep clear of them.
        X_OM: Pose of the marker on the goal object; None if it carries none.
        marker_size: Side of its black square [m].
        axis: The axis of the hand whose direction matters for the task.
    """

    model: ControlModel
    arm: str
    X_OG: RigidTransform
    coupling: Coupling | None
    ik: DifferentialIkParams
    params: ReachPlannerParams
    image_period: float
    goal_solids: Sequence[Solid] = ()
    X_OM: RigidTransform | None = None
    marker_size: float = 0.0
    axis: GoalAxis = field(default_factory=GoalAxis)

    @classmethod
    def in_scene(
        cls,
        scene: Scene,
        model: ControlModel,
        coupling: Coupling | None,
        ik: DifferentialIkParams,
        params: ReachPlannerParams,
        image_period: float,
    ) -> "ReachTask":
        """Returns the task of reaching for a scene's goal object."""
        x, y, z = scene.goal.pre_grasp.axis
        marked = MarkedObject.from_scene(scene.goal)
        return cls(
            model,
            scene.arm,
            scene.pre_grasp(),
            coupling,
            ik,
            params,
            image_period,
            marked.solids,
            marked.X_OM,
            marked.marker_size,
            GoalAxis((x, y, z), scene.goal.pre_grasp.tolerance),
        )
