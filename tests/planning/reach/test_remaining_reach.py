"""Plans for an arm on its way: around what comes, and back to its first posture."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.diagrams.factory import make_coupling
from pepper_drake.models.control_model import (
    CONTROL_PERIOD,
    arm_joints,
    body_indices,
)
from pepper_drake.models.scene import default_pre_grasp
from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.gaze.head_aiming import camera_pose
from pepper_drake.perception.gaze.view_planning import head_grid
from pepper_drake.perception.mapping.dynamic_obstacles import DepthFrame
from pepper_drake.perception.mapping.seen_space import SeenSpace
from pepper_drake.perception.mapping.voxel_map import VoxelMap
from pepper_drake.planning.collision.arm_collision_checker import ArmCollisionChecker
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.reach_plan import PlanStatus
from tests.planning.reach.planner_setup import (
    ARM,
    MODEL,
    STAND,
    TABLE,
    in_torso,
    make_planner,
    object_at,
    observed,
    stand,
)


def test_on_its_way_the_arm_goes_around_what_comes_up(tolerant, at_the_table, true_clearance):
    plan = tolerant.check_reach(at_the_table)
    path, now = plan.joint_path, len(plan.joint_path) // 3
    joints = STAND.copy()
    arm = body_indices(arm_joints("right"))
    joints[arm] = path[now]
    velocity = (path[now] - path[now - 1]) / CONTROL_PERIOD
    # A ball of points where the hand would be a little later.
    later = MODEL.create_context()
    ahead = joints.copy()
    ahead[arm] = path[now + round(0.9 / CONTROL_PERIOD)]
    MODEL.plant.SetPositions(later, MODEL.positions(ahead, at_the_table.base_pose))
    center = MODEL.pose(later, "r_hand_effector").translation()
    directions = np.random.default_rng(0).standard_normal((40, 3))
    ball = center + 0.02 * directions / np.linalg.norm(directions, axis=1)[:, None]
    seen = replace(
        at_the_table,
        arm=ArmState(path[now], velocity),
        cloud=np.concatenate((TABLE, ball)),
    )
    assert tolerant.remaining_clearance(plan, seen).minimum < 0.0

    again = tolerant.replan(plan, seen)
    assert again.status == PlanStatus.CLEAR
    np.testing.assert_array_equal(again.joint_path[0], path[now])
    limits = MODEL.command_limits(arm_joints("right"), speed_fraction=0.5)
    change = (again.joint_path[1] - again.joint_path[0]) / CONTROL_PERIOD - velocity
    assert np.all(np.abs(change) <= limits.acceleration * CONTROL_PERIOD + 1e-6)
    assert again.position_error < 0.006
    points = in_torso(seen.cloud, at_the_table.base_pose)
    truth = min(true_clearance("right", q, points) for q in again.joint_path[::6])
    assert truth >= tolerant.params.clearance.start - 1e-9
    assert tolerant.remaining_clearance(again, seen).minimum >= tolerant.params.clearance.start


def reached(at_the_table, plan):
    """The observation once the arm is at the end of a plan."""
    return replace(at_the_table, arm=ArmState(plan.joint_path[-1], np.zeros(5)))


def test_the_arm_finds_back_to_where_it_started(tolerant, at_the_table, true_clearance):
    plan = tolerant.check_reach(at_the_table)
    back = tolerant.plan_return(plan.joint_path, STAND[ARM], reached(at_the_table, plan))
    assert (back.status, back.movement.origin) == (PlanStatus.CLEAR, Origin.RETURN)
    np.testing.assert_array_equal(back.joint_path[0], plan.joint_path[-1])
    np.testing.assert_allclose(back.joint_path[-1], STAND[ARM], atol=0.02)
    points = in_torso(at_the_table.cloud, at_the_table.base_pose)
    truth = min(true_clearance("right", q, points) for q in back.joint_path[::6])
    assert truth >= tolerant.params.clearance.start - 1e-9


def test_the_way_back_does_not_follow_the_goal_object(tolerant, at_the_table):
    """With the object it moved, through what was not checked."""
    plan = tolerant.check_reach(at_the_table)
    back = tolerant.plan_return(plan.joint_path, STAND[ARM], reached(at_the_table, plan)).movement
    evaluator = tolerant._evaluator
    X_TH = RigidTransform(evaluator.kinematics.hand_pose(STAND[ARM]))
    for moved in (0.0, 0.2):
        X_WO = RigidTransform(at_the_table.p_WO + [0.0, moved, 0.0])
        X_TO = evaluator.scenes(replace(at_the_table, X_WO=X_WO)).X_TO
        assert back.hand_goal(X_TO).IsNearlyEqualTo(X_TH, 0.02)


def test_the_arm_does_not_go_back_through_what_came_in_between(tolerant, at_the_table):
    plan = tolerant.check_reach(at_the_table)
    there = reached(at_the_table, plan)
    context = MODEL.create_context()
    MODEL.plant.SetPositions(context, MODEL.positions(STAND, at_the_table.base_pose))
    hand = MODEL.pose(context, "r_hand_effector").translation()
    ball = hand + 0.03 * np.random.default_rng(0).standard_normal((60, 3))
    blocked = replace(there, cloud=np.concatenate((TABLE, ball)))
    assert tolerant.plan_return(plan.joint_path, STAND[ARM], blocked).status != PlanStatus.CLEAR


def test_without_adaptation_no_way_back_is_planned(right_primitive, at_the_table):
    reactive = make_planner(right_primitive, make_coupling("barrier"), adapt=False)
    plan = reactive.simulate_taught(at_the_table)
    back = reactive.plan_return(plan.joint_path, STAND[ARM], reached(at_the_table, plan))
    assert back.status == PlanStatus.NO_CLEAR_PATH


@pytest.mark.parametrize(
    ("lacks", "then", "at_last", "origin", "is_clear"),
    [
        (0.002, 0.002, 0.0, Origin.RETURN, True),
        (0.002, 0.002, 0.0, Origin.DETOUR, True),
        (0.002, 0.002, 0.0, Origin.TAUGHT, False),
        (0.002, 0.002, 0.001, Origin.RETURN, False),
        (0.002, 0.003, 0.0, Origin.RETURN, False),
        (0.006, 0.006, 0.0, Origin.RETURN, False),
        (-0.001, 0.001, 0.0, Origin.RETURN, False),
    ],
    ids=["leaves", "leaves", "starts", "stays", "comes nearer", "is too near", "was clear"],
)
def test_an_arm_that_is_a_little_too_near_the_own_body_may_leave(
    planner, monkeypatch, lacks, then, at_last, origin, is_clear
):
    plan = stand(planner, object_at())
    needed = planner.params.hanging_clearance
    first, last = plan.joint_path[[0, -1]]

    def near(self, q, within=np.inf):
        is_first, is_last = np.all(q == first, axis=1), np.abs(q - last).max(axis=1) < 1e-3
        return needed - np.where(is_first, lacks, np.where(is_last, at_last, then))

    monkeypatch.setattr(ArmCollisionChecker, "self_distances", near)
    evaluator = planner._evaluator
    scene = evaluator.scenes(observed(plan.base_pose, object_at()))
    again = evaluator.evaluate(scene, replace(planner.demonstrated, origin=origin))
    assert (again.status == PlanStatus.CLEAR) == is_clear


NOBODY = np.zeros((0, 3))


def test_on_its_way_the_arm_names_a_place_ahead_that_was_not_seen_lately(planner, at_the_table):
    plan = planner.check_reach(at_the_table)
    np.testing.assert_array_equal(plan.p_WO, at_the_table.p_WO)
    middle = len(plan.joint_path) // 2
    context = MODEL.create_context()
    MODEL.plant.SetPositions(context, MODEL.positions(STAND, at_the_table.base_pose))
    X_WT = MODEL.pose(context, "torso")
    camera = CAMERA_DEPTH.intrinsics
    depth = np.full((camera.height, camera.width), 3.0, np.float32)
    space = SeenSpace(VoxelMap.empty())
    for head in head_grid():
        frame = DepthFrame(depth, X_WT @ camera_pose(CAMERA_DEPTH, head), 10.0, camera)
        space = replace(space, views=(*space.views, frame))
    arm = ArmState(plan.joint_path[middle], np.zeros(5))
    seen = replace(at_the_table, arm=arm, space=space, time=10.2)
    soon = planner.stale_space(plan, seen, NOBODY, NOBODY)
    params = planner.params.unseen
    # Images of now are too old when the arm passes later.
    assert soon.time >= params.recent - 0.2 - params.stride
    assert planner.stale_space(plan, replace(seen, time=10.5), NOBODY, NOBODY).time < soon.time

    late = planner.stale_space(plan, replace(seen, time=12.0), NOBODY, NOBODY)
    assert late.time <= 3 * params.stride
    assert late.fastest > 0.1
    hand = arm_kinematics(MODEL, "right").hand_pose(arm.position).translation()
    come = (X_WT @ (hand + [0.25, 0.0, 0.0]))[None]
    distance = planner.stale_space(plan, seen, come, NOBODY).distance
    assert 0.05 < distance < 0.25
    ahead = round(planner.params.unseen.ahead / plan.time_step)
    passed = arm_kinematics(MODEL, "right").sphere_centers_at(
        plan.joint_path[middle : middle + ahead]
    )
    passed_W = passed.reshape(-1, 3) @ X_WT.rotation().matrix().T + X_WT.translation()
    assert np.linalg.norm(passed_W - late.place, axis=1).min() < 0.05
    assert np.isinf(planner.stale_space(plan, at_the_table, NOBODY, NOBODY).time)


def test_on_its_way_the_arm_is_told_when_there_is_no_way_on(planner, at_the_table):
    plan = planner.check_reach(at_the_table)
    middle = len(plan.joint_path) // 2
    goal = (at_the_table.X_WO @ default_pre_grasp("right", 0.033).pose()).translation()
    there = goal + np.random.default_rng(1).uniform(-0.03, 0.03, (60, 3))
    again = planner.replan(
        plan,
        replace(
            at_the_table,
            arm=ArmState(plan.joint_path[middle], np.zeros(5)),
            cloud=np.concatenate((TABLE, there)),
        ),
    )
    assert again.status != PlanStatus.CLEAR
    assert again.message
