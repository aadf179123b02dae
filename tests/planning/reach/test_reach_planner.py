from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from pepper_drake.diagrams.factory import make_coupling
from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.models.control_model import (
    CONTROL_PERIOD,
    arm_joints,
    body_indices,
)
from pepper_drake.models.scene import default_pre_grasp, load_scene
from pepper_drake.perception.mapping.seen_space import SeenSpace
from pepper_drake.perception.mapping.voxel_map import VoxelMap
from pepper_drake.planning.collision.arm_collision_checker import ArmCollisionChecker
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.clearance_table import ClearanceTable
from pepper_drake.planning.ik.goal_configurations import axis_error
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.reach_parameters import (
    FollowingErrors,
    GoalTolerances,
    ReachPlannerParams,
)
from pepper_drake.planning.reach.reach_plan import PlanStatus
from pepper_drake.planning.reach.swept_space import UnseenSpaceParams
from pepper_drake.planning.trajectories.adaptation_params import GoalAxis
from tests.planning.reach.planner_setup import (
    ARM,
    MODEL,
    ORIGIN,
    STAND,
    TABLE,
    in_torso,
    make_planner,
    object_at,
    observed,
    sheet,
    stand,
)


def test_a_free_goal_is_reached_from_a_place_near_it(planner):
    plan = stand(planner, object_at())
    assert plan.status == PlanStatus.CLEAR
    assert plan.message == ""
    assert plan.position_error <= planner.params.tolerance.arrive
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
    assert np.all(np.abs(np.diff(path, axis=0)) <= limits.velocity * CONTROL_PERIOD + 1e-9)


def test_the_tolerance_is_finer_than_what_the_whole_reach_may_miss():
    assert ReachPlannerParams().tolerance.arrive <= 0.01


@pytest.mark.parametrize("z", [2.0, 0.1])
def test_a_goal_too_high_or_too_low_is_out_of_reach(planner, z):
    plan = stand(planner, object_at(z=z))
    assert plan.status == PlanStatus.OUT_OF_REACH
    assert plan.message


def test_a_hand_that_would_end_beyond_its_tolerance_is_refused(right_primitive):
    strict = make_planner(right_primitive, None, tolerance=GoalTolerances(arrive=1e-9, accept=0.01))
    plan = stand(strict, object_at())
    assert plan.status == PlanStatus.OUT_OF_REACH
    assert plan.position_error > 1e-9


def test_from_where_it_stands_a_far_goal_is_out_of_reach(planner):
    plan = planner.check_reach(observed(ORIGIN, object_at()))
    assert plan.status == PlanStatus.OUT_OF_REACH
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
    # The goal is within reach: that a wall holds the demonstrated movement off is not the reason.
    assert plan.status == PlanStatus.NO_CLEAR_PATH
    assert plan.message.startswith("no clear path to the goal was found; as it was demonstrated,")
    again = planner.check_reach(observed([0.7, 0.0, 0.0], object_at(), np.concatenate(walls)))
    assert (again.status, again.message[:30]) == (PlanStatus.NO_CLEAR_PATH, plan.message[:30])


def test_where_nobody_can_stand_nobody_does(planner):
    # Posts all over the floor around the goal.
    posts = sheet((0.0, 2.0), (-1.2, 1.0), 0.3, spacing=0.1)
    plan = stand(planner, object_at(), posts)
    assert plan.status == PlanStatus.NO_STANDING_ROOM


def test_clearance_is_that_of_the_path_to_the_cloud(planner, true_clearance):
    table = sheet((0.9, 1.3), (-0.6, 0.4), 0.735)
    plan = stand(planner, object_at(z=0.74), table)
    assert plan.status == PlanStatus.CLEAR
    X_WT = RigidTransform(RollPitchYaw(0, 0, plan.base_pose[2]), [*plan.base_pose[:2], 0])
    context = MODEL.create_context()
    MODEL.plant.SetPositions(context, MODEL.positions(STAND, ORIGIN))
    X_WT = X_WT @ MODEL.pose(context, "torso")
    points_T = (X_WT.inverse() @ table.T).T
    truth = min(true_clearance("right", joints, points_T) for joints in plan.joint_path)
    # The planner takes what it saw to be 3 cm thick, which can only bring it nearer.
    assert planner.params.clearance.start <= plan.clearance <= truth + 1e-9


def test_the_hand_passes_around_what_an_unseen_goal_object_must_stand_on(true_clearance):
    # Nearer than the depth camera measures: the marker is seen, and nothing else.
    times, X_WO = np.linspace(0.0, 3.0, 61), object_at(x=0.30, y=-0.12, z=0.85)
    ramp = 10 * (times / 3) ** 3 - 15 * (times / 3) ** 4 + 6 * (times / 3) ** 5
    poses = arm_kinematics(MODEL, "right").poses(STAND[ARM][None])
    led = poses.hand_position[0] + ramp[:, None] * np.array([0.12, 0.0, 0.15])
    turned = RotationMatrix(poses.hand_rotation[0]).ToQuaternion().wxyz()
    shown = Demonstration.from_positions(
        times,
        led,
        rotations=np.tile(turned, (len(times), 1)),
        joints=np.tile(STAND[ARM], (len(times), 1)),
        joint_names=arm_joints("right"),
    )
    nothing_seen = replace(observed(ORIGIN, X_WO), space=SeenSpace(VoxelMap.empty()))
    plan = make_planner(
        MovementPrimitive.fit(shown, check=False),
        make_coupling("barrier"),
        unseen=UnseenSpaceParams(allow_motion=True),
    ).check_reach(nothing_seen)
    assert plan.status == PlanStatus.CLEAR
    x, y = np.meshgrid(np.linspace(-0.055, 0.055, 17), np.linspace(-0.055, 0.055, 17))
    tray = X_WO.translation() + np.column_stack((x.ravel(), y.ravel(), np.zeros(x.size)))
    context = MODEL.create_context()
    MODEL.plant.SetPositions(context, MODEL.positions(STAND, ORIGIN))
    points_T = (MODEL.pose(context, "torso").inverse() @ tray.T).T
    truth = min(true_clearance("right", joints, points_T) for joints in plan.joint_path)
    assert truth > ReachPlannerParams().clearance.start


def test_without_coupling_a_reach_is_not_refused_for_what_is_in_the_way(right_primitive, planner):
    alone = make_planner(right_primitive, None)
    base = stand(planner, object_at()).base_pose
    hand = alone.check_reach(observed(base, object_at())).joint_path[100]
    context = MODEL.create_context()
    joints = STAND.copy()
    joints[body_indices(arm_joints("right"))] = hand
    MODEL.plant.SetPositions(context, MODEL.positions(joints, base))
    in_the_way = MODEL.pose(context, "r_hand_effector").translation()[None]
    blind = alone.check_reach(observed(base, object_at(), in_the_way))
    assert blind.status == PlanStatus.CLEAR
    assert blind.clearance < 0
    seeing = planner.check_reach(observed(base, object_at(), in_the_way))
    assert seeing.clearance > blind.clearance


@pytest.mark.parametrize("coupling", ["report", "barrier"])
def test_what_is_not_vetted_is_judged_and_placed_as_if_there_were_no_coupling(
    coupling, right_primitive
):
    cloud = np.concatenate(
        (sheet((0.9, 1.3), (-0.6, 0.4), 0.735), sheet((0.92, 1.0), (-0.4, -0.2), (0.75, 0.95)))
    )
    law = make_coupling(coupling)
    asked = (object_at(z=0.74), cloud)
    alone = stand(make_planner(right_primitive, None), *asked)
    plan = stand(make_planner(right_primitive, law, adapt=False, collision_checked=False), *asked)
    assert (alone.status, alone.clearance < 0.0) == (PlanStatus.CLEAR, True)
    assert (plan.status, plan.clearance) == (PlanStatus.CLEAR, alone.clearance)
    np.testing.assert_array_equal(plan.base_pose, alone.base_pose)
    np.testing.assert_array_equal(plan.joint_path, alone.joint_path)
    assert plan.movement.coupling is law  # And that is what will be performed.
    assert not plan.collision_checked
    refused = make_planner(right_primitive, law, adapt=False).check_reach(
        observed(plan.base_pose, asked[0], cloud)
    )
    assert refused.status != PlanStatus.CLEAR
    assert refused.collision_checked


def test_what_is_not_vetted_is_refused_all_the_same_where_the_arm_does_not_reach(right_primitive):
    unvetted = make_planner(right_primitive, make_coupling("report"), collision_checked=False)
    assert stand(unvetted, object_at(z=2.0)).status == PlanStatus.OUT_OF_REACH
    near = unvetted.check_reach(observed(ORIGIN, object_at()))
    assert near.status == PlanStatus.OUT_OF_REACH


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


def test_a_movement_that_turns_the_hand_away_is_not_performed(planner, tolerant, at_the_table):
    turned = tolerant.check_reach(at_the_table)
    assert turned.movement.origin == Origin.ADAPTED
    plan = planner.check_reach(at_the_table)
    assert plan.status == PlanStatus.CLEAR
    assert plan.movement is planner.demonstrated
    # Of its clearance nothing is left for an adapted movement whose hand would be turned away.
    low = replace(at_the_table, cloud=at_the_table.cloud + [0.0, 0.0, 0.01])
    assert planner.check_reach(low).status != PlanStatus.CLEAR


def test_a_demonstration_through_the_table_becomes_a_primitive_around_it(
    tolerant, at_the_table, true_clearance
):
    adapted = tolerant.check_reach(at_the_table)
    assert adapted.movement is not tolerant.demonstrated
    assert adapted.status == PlanStatus.CLEAR
    assert adapted.position_error < 0.005
    points = in_torso(TABLE, at_the_table.base_pose)
    truth = min(true_clearance("right", q, points) for q in adapted.joint_path[::6])
    assert truth >= 0.020 - 1e-9

    # It is a primitive: it performs the path from its own start, and goes where its goal goes.
    primitive = adapted.movement.primitive
    path = primitive.rollout(goal=primitive.goal + [0.0, 0.02, 0.03], settle=0.4)
    np.testing.assert_allclose(path.positions[-1], primitive.goal + [0.0, 0.02, 0.03], atol=2e-3)


def test_the_pre_grasp_keeps_its_position_when_its_direction_is_adapted(tolerant, at_the_table):
    movement = tolerant.check_reach(at_the_table).movement
    np.testing.assert_array_equal(
        movement.X_OG.translation(), tolerant.demonstrated.X_OG.translation()
    )


def test_the_same_reach_is_adapted_the_same_way(tolerant, at_the_table):
    one, other = (tolerant.check_reach(at_the_table) for _ in range(2))
    np.testing.assert_array_equal(one.joint_path, other.joint_path)


def test_without_adaptation_the_hand_is_bent_around_it_more_closely(right_primitive, at_the_table):
    reactive = make_planner(right_primitive, make_coupling("barrier"), adapt=False)
    plan = reactive.check_reach(at_the_table)
    assert plan.clearance < reactive.params.clearance.want
    assert plan.movement is reactive.demonstrated


def test_the_coupling_alone_passes_the_post_of_the_first_hour(right_primitive, true_clearance):
    """In the scene that ships, the movement as it was shown would run into the post."""
    scene = load_scene("post")
    (post,) = (obstacle for obstacle in scene.obstacles if obstacle.name == "post")
    radius, length = post.size
    angles, heights = np.meshgrid(np.arange(0.0, 2 * np.pi, 0.3), np.arange(0.0, length, 0.015))
    x, y, _ = post.position
    around = np.stack([x + radius * np.cos(angles), y + radius * np.sin(angles), heights], axis=-1)
    cloud, X_WO = around.reshape(-1, 3), scene.goal.pose()
    bent = make_planner(right_primitive, make_coupling("barrier"), adapt=False)
    plan = stand(bent, X_WO, cloud)
    assert plan.status == PlanStatus.CLEAR
    assert plan.movement is bent.demonstrated
    points = in_torso(cloud, plan.base_pose)
    straight = make_planner(right_primitive, None).check_reach(observed(plan.base_pose, X_WO))
    assert min(true_clearance("right", q, points) for q in plan.joint_path[::6]) > 0.005
    assert min(true_clearance("right", q, points) for q in straight.joint_path[::6]) < 0.0


def test_no_movement_is_clear_that_runs_into_the_goal_object(planner, monkeypatch):
    """The one that was shown neither: bent by the barrier it may come from above."""
    scene = object_at()
    assert stand(planner, scene).movement is planner.demonstrated
    monkeypatch.setattr(
        ArmCollisionChecker, "object_distances", lambda self, q: np.full(len(q), -0.01)
    )
    assert stand(planner, scene).status != PlanStatus.CLEAR


@pytest.mark.parametrize("distances", ["object_distances", "self_distances"])
def test_no_movement_is_clear_that_touches_something_for_a_moment_only(
    planner, monkeypatch, distances
):
    plan = stand(planner, object_at())
    assert plan.movement is planner.demonstrated
    hand = arm_kinematics(MODEL, "right").poses(plan.joint_path).hand_position
    fastest = int(np.linalg.norm(np.diff(hand, axis=0), axis=1).argmax())
    for touched in range(fastest, fastest + 4):  # Any of these may be measured first.

        def near(self, q, within=np.inf, p_TT=hand[touched]):
            away = np.linalg.norm(self.kinematics.poses(q).hand_position - p_TT, axis=1)
            return away - 0.0005

        monkeypatch.setattr(ArmCollisionChecker, distances, near)
        observation = observed(plan.base_pose, object_at())
        again = planner.check_reach(observation)
        assert again.status != PlanStatus.CLEAR or again.movement is not planner.demonstrated


def test_the_clearance_to_the_own_body_is_that_of_the_parameters(right_primitive, planner):
    plan = stand(planner, object_at())
    assert plan.status == PlanStatus.CLEAR
    wary = make_planner(right_primitive, make_coupling("barrier"), upper_body_clearance=0.3)
    refused = wary.check_reach(observed(plan.base_pose, object_at()))
    assert refused.status != PlanStatus.CLEAR
    assert "own body" in refused.message


def test_where_nothing_is_in_the_way_the_movement_stays_the_one_that_was_shown(planner):
    plan = stand(planner, object_at())
    assert plan.movement is planner.demonstrated


def test_an_adapted_movement_keeps_a_margin_to_the_tolerance_of_the_hands_axis(
    right_primitive, tolerant, at_the_table
):
    """A hand planned a tenth of a degree within it ended a tenth beyond."""
    turned = tolerant.check_reach(at_the_table)
    R_TH = arm_kinematics(MODEL, "right").poses(turned.joint_path[-1:]).hand_rotation
    X_TO = tolerant._evaluator.scenes(at_the_table).X_TO
    R_TG = (X_TO @ tolerant.demonstrated.X_OG).rotation().matrix()
    error = float(axis_error(R_TH, R_TG, GoalAxis().direction)[0])
    margin = tolerant.params.turn_error
    for tolerance, is_turned_away in ((error + 1.1 * margin, False), (error + 0.9 * margin, True)):
        axis = GoalAxis(tolerance=tolerance)
        one = make_planner(right_primitive, make_coupling("barrier"), axis=axis)
        scene = one._evaluator.scenes(at_the_table)
        status = one._evaluator.evaluate(scene, turned.movement).status
        assert (status == PlanStatus.TURNED_AWAY) == is_turned_away
    strict = make_planner(right_primitive, make_coupling("barrier"), axis=GoalAxis(tolerance=0.006))
    assert strict._evaluator._largest_turn == pytest.approx(0.003)


def test_what_was_found_for_the_stand_is_tried_first(planner, at_the_table):
    found = planner.check_reach(at_the_table)
    again = planner.check_reach(at_the_table, found.movement)
    assert again.movement is found.movement
    np.testing.assert_allclose(again.joint_path, found.joint_path, atol=1e-9)


NARROW = ClearanceTable(0.0005, 0.001, 0.002, 0.003, 0.004, 0.006, 0.020, 0.060)
"""Clearances of which less than 7 mm is as much as is wanted."""


def test_a_movement_that_the_coupling_throws_off_its_path_is_adapted(
    right_primitive, tolerant, at_the_table
):
    """On it the arm swings elsewhere than it was simulated, as no two clouds are the same."""
    taught = tolerant.simulate_taught(at_the_table)
    good = tolerant.params.following.good
    assert taught.status == PlanStatus.CLEAR
    assert taught.clearance > NARROW.want
    for limit, origin in ((0.06, Origin.TAUGHT), (good, Origin.ADAPTED)):
        following = FollowingErrors(good=limit)
        one = make_planner(
            right_primitive,
            make_coupling("barrier"),
            axis=GoalAxis(tolerance=1.0),
            clearance=NARROW,
            following=following,
        )
        plan = one.check_reach(at_the_table)
        assert (plan.status, plan.movement.origin) == (PlanStatus.CLEAR, origin)
        assert (plan.following_error <= good) == (origin == Origin.ADAPTED)


def test_a_path_that_is_followed_closely_is_better_than_a_wider_one(planner):
    wide = replace(stand(planner, object_at()), clearance=0.03, following_error=0.021)
    close = replace(wide, clearance=0.006, following_error=0.019)
    assert planner._evaluator.quality(close) > planner._evaluator.quality(wide)
    refused = replace(close, status=PlanStatus.NO_CLEAR_PATH)
    assert planner._evaluator.quality(wide) > planner._evaluator.quality(refused)


def test_the_following_error_is_the_largest_distance_of_the_hand_to_its_reference(
    tolerant, at_the_table
):
    plan = tolerant.simulate_taught(at_the_table)
    evaluator = tolerant._evaluator
    scene = evaluator.scenes(at_the_table)
    X_TG = plan.movement.hand_goal(scene.X_TO)
    wanted = evaluator._simulator.roll_out(plan.movement, scene.arm, X_TG, scene.field).positions
    context = MODEL.create_context()
    distances = []
    for joints, hand in zip(plan.joint_path, wanted, strict=False):
        MODEL.plant.SetPositions(
            context, MODEL.positions(np.r_[STAND[: ARM[0]], joints, STAND[ARM[-1] + 1 :]], ORIGIN)
        )
        X_TH = MODEL.pose(context, "torso").inverse() @ MODEL.pose(context, "r_hand_effector")
        distances.append(np.linalg.norm(X_TH.translation() - hand))
    assert plan.following_error == pytest.approx(max(distances), abs=1e-6)
