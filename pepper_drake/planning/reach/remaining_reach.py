"""The rest of a running movement: its clearance, a detour, a retreat, the way back."""

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.planning.collision.path_distances import arm_motion, path_distances
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.movement_from_path import fit_primitive_to_joint_path
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.planning_scene import PlanningScene
from pepper_drake.planning.reach.reach_evaluator import ReachEvaluator
from pepper_drake.planning.reach.reach_plan import PlanStatus, ReachPlan, RemainingClearance
from pepper_drake.planning.trajectories.retreat import retreat_trajectory

Vector = npt.NDArray[np.float64]


def remaining_clearance(
    evaluator: ReachEvaluator, plan: ReachPlan, observation: Observation
) -> RemainingClearance:
    """Returns the clearance along the rest of a plan's path; see `Planner`."""
    scene = evaluator.scenes(observation)
    rest = path_ahead(plan, observation)
    motion = arm_motion(evaluator.kinematics, evaluator.kinematics.poses(rest))
    indices, distances = path_distances(scene.checker.distances, rest, motion)
    times: Vector = np.asarray(plan.time_step * indices, dtype=float)
    return RemainingClearance(times, distances)


def replan(evaluator: ReachEvaluator, plan: ReachPlan, observation: Observation) -> ReachPlan:
    """Returns the best plan for the rest of a movement; see `Planner`."""
    scene = evaluator.scenes(observation)
    rest = path_ahead(plan, observation)
    duration = max((len(rest) - 1) * plan.time_step, evaluator.params.min_detour_duration)
    path = None
    if evaluator.adapter is not None:
        path = evaluator.adapter.adapt_remaining(
            scene.arm.position,
            scene.X_TO @ evaluator.demonstrated.X_OG,
            scene.checker,
            rest,
            duration,
        )
    if path is None:
        return ReachPlan(
            PlanStatus.NO_CLEAR_PATH, "there is no clear path on", observation.base_pose
        )
    return evaluator.evaluate(scene, evaluator.movement_along(scene, path, Origin.DETOUR))


def plan_retreat(
    evaluator: ReachEvaluator, travelled: Vector, observation: Observation
) -> ReachPlan:
    """Returns a plan back to where there is more clearance; see `Planner`."""
    scene = evaluator.scenes(observation)
    joints, duration = retreat_trajectory(
        travelled,
        scene.arm.position,
        scene.arm.velocity,
        scene.checker.distances,
        evaluator.params.clearance.retreat_end,
        evaluator.limits,
        evaluator.params.retreat,
    )
    return _plan_along(evaluator, scene, joints, duration, Origin.RETREAT)


def plan_return(
    evaluator: ReachEvaluator, travelled: Vector, posture: Vector, observation: Observation
) -> ReachPlan:
    """Returns a plan back to a posture (5,) [rad]; see `Planner`."""
    scene, path = evaluator.scenes(observation), None
    if evaluator.adapter is not None:
        path = evaluator.adapter.adapt_back(scene.arm.position, posture, scene.checker, travelled)
    if path is None:
        return ReachPlan(
            PlanStatus.NO_CLEAR_PATH, "there is no clear path back", observation.base_pose
        )
    return _plan_along(evaluator, scene, path.joints, path.duration, Origin.RETURN)


def _plan_along(
    evaluator: ReachEvaluator, scene: PlanningScene, joints: Vector, duration: float, origin: Origin
) -> ReachPlan:
    """Returns the plan of a movement along a joint path (N, 5) [rad] that ends off the goal."""
    kinematics = evaluator.kinematics
    primitive = fit_primitive_to_joint_path(
        kinematics, joints, duration, origin.name.lower(), evaluator.params.rest_fraction
    )
    end = kinematics.poses(joints[-1:])
    X_TG = RigidTransform(
        RotationMatrix.ProjectToRotationMatrix(end.hand_rotation[0]), end.hand_position[0]
    )
    coupling = evaluator.coupling_along(scene, primitive)
    return evaluator.evaluate(scene, Movement(primitive, coupling, origin=origin, X_TG=X_TG))


def path_ahead(plan: ReachPlan, observation: Observation) -> Vector:
    """Returns the rest (N, 5) of a plan's path, at least two configurations [rad]."""
    assert plan.joint_path is not None
    first = min(plan.nearest(observation.arm), len(plan.joint_path) - 2)
    rest: Vector = plan.joint_path[first:]
    return rest
