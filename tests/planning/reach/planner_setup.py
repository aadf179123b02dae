"""Pepper as it stands, a planner for it, and what it observes."""

import numpy as np
from pydrake.math import RigidTransform

from pepper_drake.models.control_model import (
    BODY_JOINTS,
    arm_joints,
    body_indices,
    shared_control_model,
)
from pepper_drake.models.pepper import posture_positions
from pepper_drake.models.scene import default_pre_grasp
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.planning.reach.reach_planner import ReachPlanner
from pepper_drake.planning.reach.reach_task import ReachTask
from pepper_drake.planning.trajectories.adaptation_params import GoalAxis

MODEL = shared_control_model()
STAND = np.array([posture_positions("stand", {})[name] for name in BODY_JOINTS])
NOTHING = np.zeros((0, 3))
ORIGIN = np.zeros(3)
ARM = body_indices(arm_joints("right"))


def make_planner(
    primitive, coupling, X_OM=None, axis=None, marker_size=0.0, goal_solids=(), **params
):
    return ReachPlanner(
        primitive,
        ReachTask(
            model=MODEL,
            arm="right",
            X_OG=default_pre_grasp("right", 0.033).pose(),
            coupling=coupling,
            ik=DifferentialIkParams(),
            params=ReachPlannerParams(**params),
            image_period=0.2,
            goal_solids=goal_solids,
            X_OM=X_OM,
            marker_size=marker_size,
            axis=axis or GoalAxis(),
        ),
    )


def object_at(x=0.98, y=-0.11, z=0.78):
    return RigidTransform([x, y, z])


def stand(planner, X_WO, cloud=NOTHING):
    return planner.plan_base_placement(observed(ORIGIN, X_WO, cloud))


def observed(base_pose, X_WO, cloud=NOTHING, arm=None, velocity=None):
    """An observation of a robot that stands, but for its right arm."""
    arm = STAND[ARM] if arm is None else arm
    return Observation(
        time=0.0,
        base_pose=np.asarray(base_pose),
        joint_position=STAND,
        arm=ArmState(arm, np.zeros(5) if velocity is None else velocity),
        X_WO=X_WO,
        cloud=np.asarray(cloud),
    )


def sheet(x, y, z, spacing=0.03):
    """Points on the grid of three ranges (one of them a single number)."""
    axes = [np.arange(*r, spacing) if isinstance(r, tuple) else np.array([r]) for r in (x, y, z)]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3)


TABLE = sheet((0.9, 1.3), (-0.6, 0.4), 0.735, spacing=0.02)


def in_torso(points, base_pose):
    """Points (N, 3) of W in the frame of the torso of a robot that stands."""
    context = MODEL.create_context()
    MODEL.plant.SetPositions(context, MODEL.positions(STAND, base_pose))
    return (MODEL.pose(context, "torso").inverse() @ points.T).T
