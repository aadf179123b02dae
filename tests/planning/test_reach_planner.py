from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.diagrams.reach_setup import make_coupling, make_primitive
from pepper_drake.errors import InputError
from pepper_drake.models.pepper import posture_positions
from pepper_drake.models.scene import default_pre_grasp
from pepper_drake.planning.control_model import (
    BODY_JOINTS,
    arm_joints,
    body_indices,
    shared_control_model,
)
from pepper_drake.planning.differential_ik import DifferentialIkParams
from pepper_drake.planning.reach_planner import ReachPlanner, ReachPlannerParams, ReachVerdict

MODEL = shared_control_model()
STAND = np.array([posture_positions("stand", {})[name] for name in BODY_JOINTS])
NOTHING = np.zeros((0, 3))
ORIGIN = np.zeros(3)


@pytest.fixture(scope="module")
def right_primitive():
    return make_primitive(None, "right")


@pytest.fixture(scope="module")
def planner(right_primitive):
    return make_planner(right_primitive, make_coupling("barrier"))


def make_planner(primitive, coupling, **params):
    return ReachPlanner(
        model=MODEL,
        arm="right",
        X_OG=default_pre_grasp("right", 0.033).pose(),
        primitive=primitive,
        coupling=coupling,
        ik=DifferentialIkParams(),
        params=ReachPlannerParams(**params),
    )


def object_at(x=0.98, y=-0.11, z=0.78):
    return RigidTransform([x, y, z])


def stand(planner, X_WO, cloud=NOTHING):
    return planner.plan_stand(
        base_pose=ORIGIN, joint_position=STAND, X_WO=X_WO, cloud_W=np.asarray(cloud)
    )


def sheet(x, y, z, spacing=0.03):
    """Points on the grid of three ranges (one of them a single number)."""
    axes = [np.arange(*r, spacing) if isinstance(r, tuple) else np.array([r]) for r in (x, y, z)]
    return np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 3)


def test_a_free_goal_is_reached_from_a_place_near_it(planner):
    plan = stand(planner, object_at())
    assert plan.verdict == ReachVerdict.CLEAR
    assert plan.sentence == ""
    assert plan.position_error <= planner.params.position_tolerance
    assert 0.2 < np.linalg.norm(plan.base_pose[:2] - [0.98, -0.11]) < 0.8

    # Carried out by an independent model, the last command has the hand at the goal.
    context = MODEL.create_context()
    joints = STAND.copy()
    joints[body_indices(arm_joints("right"))] = plan.joint_path[-1]
    MODEL.plant.SetPositions(context, MODEL.positions(joints, plan.base_pose))
    p_WH = MODEL.pose(context, "r_hand_effector").translation()
    p_WG = (object_at() @ default_pre_grasp("right", 0.033).pose()).translation()
    assert np.linalg.norm(p_WH - p_WG) == pytest.approx(plan.position_error, abs=1e-9)


def test_every_command_of_the_plan_is_one_that_the_arm_may_be_given(planner):
    path = stand(planner, object_at()).joint_path
    limits = MODEL.command_limits(arm_joints("right"), speed_fraction=0.5)
    np.testing.assert_array_equal(path[0], STAND[body_indices(arm_joints("right"))])
    assert np.all(path >= limits.position_lower - 1e-9)
    assert np.all(path <= limits.position_upper + 1e-9)
    assert np.all(np.abs(np.diff(path, axis=0)) <= limits.velocity * 0.01 + 1e-9)


def test_the_tolerance_is_finer_than_what_the_whole_reach_may_miss():
    assert ReachPlannerParams().position_tolerance <= 0.01


@pytest.mark.parametrize("z", [2.0, 0.1])
def test_a_goal_too_high_or_too_low_is_out_of_reach(planner, z):
    plan = stand(planner, object_at(z=z))
    assert plan.verdict == ReachVerdict.OUT_OF_REACH
    assert plan.sentence


def test_a_hand_that_would_end_beyond_its_tolerance_is_refused(right_primitive):
    strict = make_planner(right_primitive, None, position_tolerance=1e-9)
    plan = stand(strict, object_at())
    assert plan.verdict == ReachVerdict.OUT_OF_REACH
    assert plan.position_error > 1e-9


def test_from_where_it_stands_a_far_goal_is_out_of_reach(planner):
    plan = planner.check_reach(
        base_pose=ORIGIN, joint_position=STAND, X_WO=object_at(), cloud_W=NOTHING
    )
    assert plan.verdict == ReachVerdict.OUT_OF_REACH
    assert plan.position_error > 0.2


def test_a_goal_in_a_box_is_refused(planner):
    # Walls 12 cm about the object, from its bottom to above it, and a lid.
    x, y, z = object_at().translation()
    sides, height = (-0.12, 0.15), (z - 0.02, z + 0.32)
    spans = (x + sides[0], x + sides[1]), (y + sides[0], y + sides[1])
    walls = [
        *(sheet(x + dx, spans[1], height) for dx in (-0.12, 0.12)),
        *(sheet(spans[0], y + dy, height) for dy in (-0.16, 0.12)),
        sheet(*spans, z + 0.3),
    ]
    plan = stand(planner, object_at(), np.concatenate(walls))
    # The hand is held off by a wall or comes too near to it: both end before the arm starts.
    assert plan.verdict in (ReachVerdict.OUT_OF_REACH, ReachVerdict.NO_CLEAR_PATH)
    assert "mm" in plan.sentence


def test_where_nobody_can_stand_nobody_does(planner):
    # Posts all over the floor around the goal.
    posts = sheet((0.0, 2.0), (-1.2, 1.0), 0.3, spacing=0.1)
    plan = stand(planner, object_at(), posts)
    assert plan.verdict == ReachVerdict.NO_STANDING_ROOM


def test_clearance_is_that_of_the_path_to_the_cloud(planner, true_clearance):
    table = sheet((0.9, 1.3), (-0.6, 0.4), 0.735)
    plan = stand(planner, object_at(z=0.74), table)
    assert plan.verdict == ReachVerdict.CLEAR
    X_WT = RigidTransform(RollPitchYaw(0, 0, plan.base_pose[2]), [*plan.base_pose[:2], 0])
    context = MODEL.create_context()
    MODEL.plant.SetPositions(context, MODEL.positions(STAND, ORIGIN))
    X_WT = X_WT @ MODEL.pose(context, "torso")
    points_T = (X_WT.inverse() @ table.T).T
    truth = min(true_clearance("right", joints, points_T) for joints in plan.joint_path[::3])
    # The planner takes what it saw to be 3 cm thick, which can only bring it nearer.
    assert planner.params.least_clearance <= plan.clearance <= truth + 1e-9


def test_without_coupling_a_reach_is_not_refused_for_what_is_in_the_way(right_primitive, planner):
    alone = make_planner(right_primitive, None)
    base = stand(planner, object_at()).base_pose
    asked = {"base_pose": base, "joint_position": STAND, "X_WO": object_at()}
    hand = alone.check_reach(**asked, cloud_W=NOTHING).joint_path[100]
    context = MODEL.create_context()
    joints = STAND.copy()
    joints[body_indices(arm_joints("right"))] = hand
    MODEL.plant.SetPositions(context, MODEL.positions(joints, base))
    in_the_way = MODEL.pose(context, "r_hand_effector").translation()[None]
    blind = alone.check_reach(**asked, cloud_W=in_the_way)
    assert blind.verdict == ReachVerdict.CLEAR
    assert blind.clearance < 0
    seeing = planner.check_reach(**asked, cloud_W=in_the_way)
    assert seeing.clearance > blind.clearance


def test_a_call_depends_on_its_arguments_alone(planner):
    table = sheet((0.9, 1.3), (-0.6, 0.4), 0.735)
    first = stand(planner, object_at(z=0.74), table)
    stand(planner, object_at(z=2.0))
    stand(planner, object_at(x=0.8, y=0.1))
    again = stand(planner, object_at(z=0.74), table)
    np.testing.assert_array_equal(first.base_pose, again.base_pose)
    np.testing.assert_array_equal(first.joint_path, again.joint_path)
    assert (first.clearance, first.position_error) == (again.clearance, again.position_error)


@pytest.mark.parametrize("missing", ["orientation", "posture"])
def test_a_primitive_without_orientation_or_posture_is_refused(right_primitive, missing):
    with pytest.raises(InputError, match="rotations and joints"):
        make_planner(replace(right_primitive, **{missing: None}), None)
