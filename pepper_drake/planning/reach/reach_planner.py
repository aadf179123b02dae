"""The reach planner: whether the hand can reach its goal, from where, and along which path."""

from dataclasses import replace
from functools import partial

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix
from scipy.spatial import cKDTree

from pepper_drake.learning import MovementPrimitive
from pepper_drake.models.control_model import CommandLimits
from pepper_drake.perception.mapping.seen_space import SeenSpace
from pepper_drake.planning.collision.body_clearance import BodyClearance, body_links
from pepper_drake.planning.reach.base_placement import BasePlacement
from pepper_drake.planning.reach.base_placement_planner import BasePlacementPlanner
from pepper_drake.planning.reach.leaning import LeaningPlacement
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_evaluator import ReachEvaluator
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.planning.reach.reach_plan import PlanStatus, ReachPlan, RemainingClearance
from pepper_drake.planning.reach.reach_task import ReachTask
from pepper_drake.planning.reach.remaining_reach import (
    path_ahead,
    plan_retreat,
    plan_return,
    remaining_clearance,
    replan,
)
from pepper_drake.planning.reach.separation import StaleSpace
from pepper_drake.planning.reach.swept_space import (
    UnseenSpace,
    UnseenSpaceParams,
    best_look,
    unseen_drive_space,
    unseen_sentence,
    unseen_space,
)

__all__ = ["PlanStatus", "ReachPlan", "ReachPlanner", "ReachPlannerParams"]

Vector = npt.NDArray[np.float64]

_AROUND_CAMERA = ("Head", "Neck")
"""Links that turn with the depth camera and do not occlude its view."""


class ReachPlanner:
    """Implements `Planner` by kinematic simulation and adaptation of the demonstrated movement.

    A movement that is not clear is adapted: the path of the whole arm is optimised until it is
    clear, and a primitive is fitted to it. The planner is stateless: plans depend on the arguments
    only.

    Args:
        primitive: Primitive with orientation and posture.
        task: Arm, goal and criteria.

    Attributes:
        base_placement: Generates candidate base poses.
        leaning: Chooses base placement and hip angle.

    Raises:
        InputError: The primitive has no orientation or no posture.
    """

    def __init__(self, primitive: MovementPrimitive, task: ReachTask) -> None:
        self._task, model, arm = task, task.model, task.arm
        self._evaluator = ReachEvaluator(primitive, task)
        self.base_placement = BasePlacement(model, arm, task.X_OG, primitive.goal, task.params)
        self._body, self._carried = (
            BodyClearance(model, [name for name in names if name not in _AROUND_CAMERA])
            for names in (body_links(model, arm), body_links(model))
        )
        self._base_planner = BasePlacementPlanner(self._evaluator, self.base_placement)
        self.leaning = LeaningPlacement(
            self._base_planner, self._evaluator, partial(self._body_spheres, self._body), task
        )

    def with_primitive(
        self, primitive: MovementPrimitive, X_OG: RigidTransform | None = None
    ) -> "ReachPlanner":
        """Returns a planner for another primitive and, if given, another pre-grasp pose."""
        task = self._task if X_OG is None else replace(self._task, X_OG=X_OG)
        return type(self)(primitive, task)

    @property
    def demonstrated(self) -> Movement:
        """The movement as it was demonstrated."""
        return self._evaluator.demonstrated

    @property
    def params(self) -> ReachPlannerParams:
        """Criteria of a good reach."""
        return self._evaluator.params

    @property
    def limits(self) -> CommandLimits:
        """Limits of the arm's joint commands."""
        return self._evaluator.limits

    def plan_base_placement(self, observation: Observation) -> ReachPlan:
        """Returns the best plan over all base placements; see `Planner`."""
        plan = self.leaning.plan(observation)
        clear = plan.status == PlanStatus.CLEAR
        return self._with_unseen_drive(plan, observation) if clear else plan

    def look_along_drive(self, observation: Observation) -> Vector:
        """Returns where to look before the base placement is known; see `Planner`."""
        places = self.base_placement.within_reach(
            observation.base_pose,
            observation.joint_position,
            observation.X_WO,
            self.params.reach_margin,
        )
        likely = next(places, observation.base_pose)
        plan = ReachPlan(PlanStatus.CLEAR, "", np.asarray(likely))
        return self._with_unseen_drive(plan, observation).look_at

    def check_drive(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns a base placement, checked again; see `Planner`."""
        lost, hip_pitch = self.params.placement_clearance_tolerance, plan.hip_pitch
        if hip_pitch is None:
            has_room = self._base_planner.has_room(plan.base_pose[None], observation, lost=lost)[0]
        else:
            has_room = self.leaning.may_lean(plan, observation, hip_pitch, lost)
        if not has_room:
            sentence = "something stands where the robot was going to drive"
            return replace(plan, status=PlanStatus.NO_STANDING_ROOM, message=sentence)
        return self._with_unseen_drive(plan, observation)

    def check_reach(self, observation: Observation, movement: Movement | None = None) -> ReachPlan:
        """Returns the best plan from the present base pose; see `Planner`."""
        evaluator = self._evaluator
        scene = evaluator.scenes(observation)
        best = evaluator.evaluate(scene, self.demonstrated if movement is None else movement)
        if evaluator.is_good(best):
            return self._with_unseen(best, observation)
        for plan in evaluator.adapted(scene, best.joint_path):
            best = max(best, plan, key=evaluator.quality)
        if movement is not None and best.status != PlanStatus.CLEAR:
            demonstrated = evaluator.evaluate(scene, self.demonstrated)
            best = max(best, demonstrated, key=evaluator.quality)
        return self._with_unseen(evaluator.explained(best, observation), observation)

    def replan(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns the best plan for the rest of a movement; see `Planner`."""
        detour = replan(self._evaluator, plan, observation)
        return self._with_unseen(detour, observation)

    def plan_retreat(self, travelled: Vector, observation: Observation) -> ReachPlan:
        """Returns a plan back to a configuration with more clearance; see `Planner`."""
        return plan_retreat(self._evaluator, travelled, observation)

    def plan_return(
        self, travelled: Vector, posture: Vector, observation: Observation
    ) -> ReachPlan:
        """Returns a plan back to a posture; see `Planner`."""
        back = plan_return(self._evaluator, travelled, posture, observation)
        return self._with_unseen(back, observation)

    def remaining_clearance(self, plan: ReachPlan, observation: Observation) -> RemainingClearance:
        """Returns the clearance along the rest of a plan's path; see `Planner`."""
        return remaining_clearance(self._evaluator, plan, observation)

    def stale_space(
        self, plan: ReachPlan, observation: Observation, new_obstacle: Vector, movable: Vector
    ) -> StaleSpace:
        """Returns space that the arm sweeps soon and that was not seen recently; see `Planner`."""
        params, space = self.params.unseen, observation.space
        if plan.joint_path is None:
            return StaleSpace()
        ahead = path_ahead(plan, observation)[: round(params.ahead / plan.time_step) + 1]
        stride = _stride(plan.time_step, params)
        duration = stride * plan.time_step
        centers = self._evaluator.kinematics.sphere_centers_at(ahead[::stride])
        place, first = StaleSpace().place, len(centers)
        if space is not None:
            recently = replace(params, max_age=params.recent)
            unseen = self._unseen(
                ahead, plan.time_step, observation, space, recently, duration, movable
            )
            if unseen.regions:
                first = min(unseen.first)
                x, y, z = unseen.regions[unseen.first.index(first)].mean(axis=0)
                place = (x, y, z)
        # Distance of a new obstacle to the part of the path before the next image.
        near = centers[: round(self._task.image_period / duration) + 1].reshape(-1, 3)
        distance = np.inf
        if len(new_obstacle):
            X_WT = self._evaluator.scenes.torso_pose(observation)
            near_W = near @ X_WT.rotation().matrix().T + X_WT.translation()
            radius = float(np.max(self._evaluator.kinematics.spheres.radii))
            distance = float(np.min(cKDTree(new_obstacle).query(near_W)[0])) - radius
        steps = np.linalg.norm(np.diff(centers[: first + 2], axis=0), axis=2)
        fastest = float(steps.max(initial=0.0)) / duration
        # Near movable things the space counts as entered one configuration earlier.
        entry = max(first - int(len(movable) > 0), 0)
        time = entry * duration if first < len(centers) else np.inf
        return StaleSpace(place, time, fastest, distance)

    def simulate_taught(self, observation: Observation) -> ReachPlan:
        """Returns the plan of the taught movement with its coupling, without adaptation."""
        evaluator = self._evaluator
        return evaluator.evaluate(evaluator.scenes(observation), self.demonstrated)

    def _with_unseen(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Adds its goal to a plan and, making it not clear, the unseen part of the swept volume."""
        params, space = self.params.unseen, observation.space
        plan = replace(plan, p_WO=observation.p_WO)
        if plan.status != PlanStatus.CLEAR or plan.joint_path is None or space is None:
            return plan
        unseen = self._unseen(plan.joint_path, plan.time_step, observation, space, params)
        region = unseen.region
        plan = replace(plan, unseen=region, out_of_view=unseen.out_of_view)
        if not len(region) or params.allow_motion or not plan.collision_checked:
            return plan
        plan = replace(plan, look_at=region.mean(axis=0))
        X_WT = self._evaluator.scenes.torso_pose(observation)
        sentence = unseen_sentence(region, X_WT, params)
        return replace(plan, status=PlanStatus.NOT_SEEN, message=sentence)

    def _with_unseen_drive(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Adds the unseen space swept by its drive to a base placement, which is then not clear."""
        params, space = self.params.unseen, observation.space
        if space is None or not params.check_drive:
            return plan
        X_WT = self._evaluator.scenes.torso_pose(observation)
        spheres = self._body_spheres(self._carried, observation, X_WT)
        unseen = unseen_drive_space(
            self.base_placement.resting_clearances,
            observation.base_pose,
            plan.base_pose,
            observation.joint_position,
            X_WT,
            spheres,
            space,
            observation.time,
            params,
            [one.joint_position for one in observation.leaning_to(plan.hip_pitch)],
        )
        region = unseen.region
        plan = replace(
            plan,
            status=PlanStatus.CLEAR,
            message="",
            unseen=region,
            out_of_view=unseen.out_of_view,
            look_at=best_look(unseen, X_WT, spheres, params),
        )
        if not len(region) or params.allow_motion:
            return plan
        sentence = unseen_sentence(region, X_WT, params, "the robot")
        return replace(plan, status=PlanStatus.NOT_SEEN, message=f"on its drive {sentence}")

    def _unseen(
        self,
        path: Vector,
        time_step: float,
        observation: Observation,
        space: SeenSpace,
        params: UnseenSpaceParams,
        stride: float = 0.0,
        movable: Vector | None = None,
    ) -> UnseenSpace:
        """Returns unseen space that the arm sweeps on a path (N, 5) [rad] of a time step [s]."""
        X_WT = self._evaluator.scenes.torso_pose(observation)
        return unseen_space(
            self._evaluator.kinematics,
            path[:: _stride(time_step, params)],
            X_WT,
            space,
            observation.time,
            params,
            self._body_spheres(self._body, observation, X_WT),
            stride=stride,
            movable=movable,
        )

    def _body_spheres(
        self, body: BodyClearance, observation: Observation, X_WT: RigidTransform
    ) -> tuple[Vector, Vector]:
        """Returns centres (S, 3) in T and radii (S,) of the spheres of some links [m]."""
        x, y, yaw = observation.base_pose
        X_WB = RigidTransform(RotationMatrix.MakeZRotation(yaw), [x, y, 0.0])
        X_TB = X_WT.InvertAndCompose(X_WB)
        centers = body.centers(observation.joint_position)
        return centers @ X_TB.rotation().matrix().T + X_TB.translation(), body.radii

    def demonstrated_path(self, count: int = 200) -> Vector:
        """Returns the hand's demonstrated path (count, 3), from its own start to its goal [m]."""
        primitive = self.demonstrated.primitive
        return primitive.rollout(time_step=primitive.duration / (count - 1)).positions


def _stride(time_step: float, params: UnseenSpaceParams) -> int:
    """Returns the number of time steps between the checked configurations of a path."""
    return max(round(params.stride / time_step), 1)
