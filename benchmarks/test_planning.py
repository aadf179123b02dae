"""Durations of base placement, planning and replanning."""

import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.diagrams.factory import make_coupling, make_primitive
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

GOAL = RigidTransform([0.98, -0.11, 0.74])
SHIFT = np.array([0.03, 0.0, 0.0])
"""Base displacement with which the barrier alone no longer leads the hand around the edge."""


@pytest.fixture(scope="module")
def planner():
    return ReachPlanner(
        make_primitive(None, "right"),
        ReachTask(
            model=shared_control_model(),
            arm="right",
            X_OG=default_pre_grasp("right", 0.033).pose(),
            coupling=make_coupling("barrier"),
            ik=DifferentialIkParams(),
            params=ReachPlannerParams(),
            image_period=0.2,
        ),
    )


@pytest.fixture(scope="module")
def seen():
    """A table of 5,000 points."""
    rng = np.random.default_rng(0)
    xy = rng.uniform([0.9, -0.6], [1.3, 0.4], (5000, 2))
    posture = posture_positions("stand", {})
    joints = np.array([posture[name] for name in BODY_JOINTS])
    arm = ArmState(joints[body_indices(arm_joints("right"))], np.zeros(5))
    cloud = np.column_stack((xy, np.full(len(xy), 0.735)))
    return Observation(0.0, np.zeros(3), joints, arm, GOAL, cloud)


@pytest.fixture(scope="module")
def place(planner, seen):
    return planner.plan_base_placement(seen).base_pose


def test_a_place_to_stand(benchmark, planner, seen):
    plan = benchmark(planner.plan_base_placement, seen)
    assert plan.status == "clear"


def test_the_movement_that_was_shown(benchmark, planner, seen, place):
    plan = benchmark(planner.check_reach, seen.from_base_pose(place))
    assert plan.movement is planner.demonstrated


def test_an_adapted_movement(benchmark, planner, seen, place):
    plan = benchmark(planner.check_reach, seen.from_base_pose(place + SHIFT))
    assert plan.status == "clear"
    assert plan.movement is not planner.demonstrated


def test_whether_the_rest_is_clear(benchmark, planner, seen, place):
    seen = seen.from_base_pose(place + SHIFT)
    plan = planner.check_reach(seen)
    ahead = benchmark(planner.remaining_clearance, plan, seen)
    assert ahead.minimum == pytest.approx(plan.clearance, abs=0.01)


def test_replanning_on_the_way(benchmark, planner, seen, place):
    seen = seen.from_base_pose(place + SHIFT)
    plan = planner.check_reach(seen)
    again = benchmark(planner.replan, plan, seen)
    assert again.status == "clear"
