from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.planning.reach.reach_plan import PlanStatus
from pepper_drake.planning.reach.separation import StaleSpace
from pepper_drake.planning.trajectories.retreat import (
    NewObstacleParams,
    dilate_new_points,
    extrude_new_points_down,
)
from tests.planning.reach.scripted_planner import (
    ADAPTED,
    BESIDE,
    CLOUD,
    NO_DETOUR,
    STALE,
    THING,
    TIMING,
    X_WO,
    Supervised,
    on_its_way,
    path_plan,
)

LATENCY = TIMING.latency
STEP = TIMING.time_step
TICK = 0.02
"""Time step of the paths."""


def test_the_rest_of_the_movement_is_checked_once_for_each_cloud():
    one = on_its_way()
    for _ in range(2):
        one.look().advance(0.25)
    assert one.planner.questions() == ["remaining_clearance"] * 2
    np.testing.assert_array_equal(
        one.planner.last("remaining_clearance").arm.position, one.seen.arm.position
    )


def test_the_head_looks_where_the_arm_passes_soon_and_was_not_seen_lately():
    one = on_its_way()
    assert np.isnan(one.state.look_at).all()
    one.planner.stale = STALE
    assert one.look().state.look_at == STALE.place
    one.planner.stale = StaleSpace()
    assert np.isnan(one.look().state.look_at).all()


def test_the_arm_is_slow_where_its_clearance_is_small():
    slow = ReachPlannerParams().clearance.slow
    one = on_its_way(ahead=slow + 0.001, stale=StaleSpace(fastest=0.5))
    one.state = replace(one.state, plan=path_plan(clearance=0.006))
    one.look().advance(0.5)
    assert one.state.speed == 1.0
    one.planner.ahead, one.planner.ahead_from = slow - 0.001, 0.0
    one.look().advance(0.5)
    assert one.state.speed * 0.5 == pytest.approx(TIMING.separation.touch_speed)


def test_a_detour_takes_effect_a_planning_latency_after_its_observation():
    one = on_its_way(ahead=0.004)
    first, before = one.time, one.state.plan
    one.look()
    while one.state.plan is before:
        assert one.state.active_movement == 1  # The old movement goes on.
        one.step()
    assert one.time - STEP - first == pytest.approx(LATENCY.plan)
    assert one.state.active_movement == 2
    assert one.state.plan is one.planner.detour
    assert one.planner.questions().count("replan") == 1


def test_a_detour_without_a_movement_is_not_begun():
    """The arm would have performed the demonstration from where it is."""
    one = on_its_way(ahead=0.004, detour=replace(path_plan(), movement=None))
    one.look().failed("plan_invalid")


def test_a_detour_to_another_place_than_the_goal_is_not_begun():
    led_astray = replace(path_plan(), p_WO=X_WO.translation() + [0.0, 0.03, 0.04])
    one = on_its_way(ahead=0.004, detour=led_astray)
    one.look().failed("plan_invalid")
    assert "50 mm from the one that is seen" in one.state.message


def test_a_detour_to_a_goal_that_moves_on_while_it_is_planned_is_begun():
    one = on_its_way(ahead=0.004, detour=replace(path_plan(), p_WO=X_WO.translation()))
    one.look()
    moved = RigidTransform(X_WO.rotation(), X_WO.translation() + [0.0, 0.0, 0.05])
    one.set(X_WO=moved).advance(2.0 * LATENCY.plan)
    assert one.state.plan is one.planner.detour


def adapted_plan(moved=0.0):
    """A plan of an adapted movement to a goal that is higher by some distance [m]."""
    movement = replace(ADAPTED, origin=Origin.ADAPTED)
    p_WO = X_WO.translation() + [0.0, 0.0, moved]
    return replace(path_plan(), p_WO=p_WO, movement=movement)


def goal_higher_by(moved):
    return RigidTransform(X_WO.rotation(), X_WO.translation() + [0.0, 0.0, moved])


@pytest.mark.parametrize(
    ("moved", "origin", "planned_anew"),
    [
        (0.014, Origin.ADAPTED, False),
        (0.016, Origin.ADAPTED, True),
        (0.016, Origin.DETOUR, True),
        # As primitives do.
        (0.080, Origin.TAUGHT, False),
    ],
)
def test_an_adapted_movement_is_planned_anew_where_its_goal_goes(moved, origin, planned_anew):
    """Followed as it was planned, the hand passed where nothing had been checked."""
    before = adapted_plan()
    before = replace(before, movement=replace(before.movement, origin=origin))
    one = on_its_way(detour=adapted_plan(moved))
    one.state = replace(one.state, plan=before)
    velocity = np.array([0.3, 0.2, 0.0, 0.0, 0.0])
    arm = ArmState(one.seen.arm.position, velocity)
    one.set(X_WO=goal_higher_by(moved), arm=arm).look()
    if planned_anew:  # An arm that follows the goal does not go on along its path.
        start = one.planner.last("replan").arm
        displacement = (LATENCY.plan + TICK) * velocity
        np.testing.assert_allclose(start.position, arm.position + displacement)
        np.testing.assert_allclose(start.velocity, velocity)
    one.advance(2.0 * LATENCY.plan)
    assert one.state.plan is (one.planner.detour if planned_anew else before)
    assert one.state.suspended_plan is None


@pytest.mark.parametrize("moved", [0.025, 0.08])
def test_a_goal_to_which_no_path_is_found_is_followed_no_further_than_a_little(moved):
    one = on_its_way(detour=NO_DETOUR)
    before = adapted_plan()
    one.state = replace(one.state, plan=before)
    one.set(X_WO=goal_higher_by(moved)).look().advance(2.0 * LATENCY.plan)
    assert one.planner.questions().count("replan") == 1
    assert one.state.braking == (moved > ReachPlannerParams().tolerance.jumped)
    assert (one.state.plan, one.state.suspended_plan) == (before, None)


def test_an_arm_that_braked_for_a_goal_that_moved_goes_there_once_there_is_a_path():
    one = on_its_way(detour=NO_DETOUR)
    one.state = replace(one.state, plan=adapted_plan())
    one.set(X_WO=goal_higher_by(0.08)).look().advance(2.0 * LATENCY.check)
    assert one.state.braking
    one.planner.detour = adapted_plan(0.08)
    one.look().advance(2.0 * LATENCY.plan)
    assert one.state.plan is one.planner.detour
    assert not one.state.braking


def test_a_detour_starts_where_the_arm_will_be_when_it_takes_effect():
    one = on_its_way(ahead=0.004).look()
    start = one.planner.last("replan").arm
    np.testing.assert_allclose(start.position, [0.3 + 0.5 * (LATENCY.plan + TICK), 0, 0, 0, 0])
    np.testing.assert_allclose(start.velocity, [0.5, 0, 0, 0, 0])


@pytest.mark.parametrize("latency", [0.101, 0.12, 0.15])
def test_a_detour_starts_in_a_tick_of_the_supervisor_whatever_its_latency(latency):
    one = on_its_way(replace(TIMING, latency=replace(LATENCY, plan=latency)), ahead=0.004)
    first, before = one.time, one.state.plan
    one.look()
    while one.state.plan is before:
        one.step()
    begun = one.time - STEP - first
    assert begun == pytest.approx(0.15)
    start = one.planner.last("replan").arm
    # The controller's first tick after that.
    np.testing.assert_allclose(start.position, [0.3 + 0.5 * 0.16, 0, 0, 0, 0])


def test_what_an_arm_is_off_its_path_it_is_predicted_to_stay_off():
    plan = path_plan()
    arm = ArmState(np.array([0.3, 0.01, 0, 0, 0]), np.array([0.4, 0.02, 0, 0, 0]))
    later = plan.predict(arm, 0.6, 0.2)
    np.testing.assert_allclose(later.position, [0.4, 0.01, 0, 0, 0])
    np.testing.assert_allclose(later.velocity, [0.4, 0.02, 0, 0, 0])
    at_end = plan.predict(arm, 0.6, 10.0)
    np.testing.assert_allclose(at_end.position, [1.0, 0.01, 0, 0, 0])
    np.testing.assert_allclose(at_end.velocity, [-0.1, 0.02, 0, 0, 0])
    assert plan.predict(arm, 0.6, 0.0).position is not arm.position
    np.testing.assert_array_equal(plan.predict(arm, 0.6, 0.0).velocity, arm.velocity)


def test_on_a_path_that_turns_back_time_tells_where_the_arm_is():
    there = path_plan().joint_path
    plan = replace(path_plan(), joint_path=np.concatenate((there, there[-2::-1])))
    arm = ArmState(np.array([0.5, 0, 0, 0, 0]), np.array([0.5, 0, 0, 0, 0]))
    assert plan.predict(arm, 1.0, 0.2).position[0] == pytest.approx(0.6)
    assert plan.predict(arm, 3.0, 0.2).position[0] == pytest.approx(0.4)


def test_an_arm_with_something_right_before_it_brakes_at_once():
    one = on_its_way(ahead=0.0, ahead_from=0.1).look()
    assert one.state.active_movement == 1
    one.step()
    assert one.state.active_movement == 0
    # Three ticks on until the arm brakes, and then to a stand, 0.2 rad/s less each tick.
    start = one.planner.last("replan").arm
    expected = 0.3 + TICK * (3 * 0.5 + 0.3 + 0.1)
    np.testing.assert_allclose(start.position, [expected, 0, 0, 0, 0], atol=1e-9)
    np.testing.assert_array_equal(start.velocity, np.zeros(5))
    one.advance(LATENCY.plan - STEP)
    assert one.state.active_movement == 2


def test_an_arm_brakes_at_once_for_a_moving_obstacle_however_far_ahead():
    one = on_its_way(ahead=0.0, ahead_from=1.0).set(predicted_cloud=BESIDE[None]).look()
    assert one.step().active_movement == 0
    one.advance(LATENCY.plan - STEP)
    assert one.state.plan is one.planner.back
    assert one.state.active_movement == 2


def test_an_arm_goes_on_past_a_moving_obstacle_that_leaves_its_path_free():
    one = on_its_way(ahead=0.02).set(predicted_cloud=BESIDE[None]).look().advance(0.3)
    assert one.state.active_movement == 1


def test_an_arm_that_brakes_from_high_speed_stands_before_another_movement_begins():
    one = on_its_way(ahead=0.0, ahead_from=0.0)
    first = one.time
    velocity = np.array([0.5, 0.0, 3.0, 0.0, -0.4])
    one.set(arm=ArmState(one.seen.arm.position, velocity)).look()
    start = one.planner.last("replan").arm
    np.testing.assert_array_equal(start.velocity, np.zeros(5))
    braked = TICK * np.arange(0.2, 3.0, 0.2).sum()
    np.testing.assert_allclose(start.position[2:], [braked, 0.0, -TICK * 0.2], atol=1e-9)
    while one.state.movements == 1:
        one.step()
    # Three ticks on, then 3 rad/s that fall by 10 rad/s².
    begun = one.time - STEP - first
    assert 3 * TICK + 0.3 <= begun <= 3 * TICK + 0.3 + STEP


def test_an_arm_with_something_far_ahead_does_not_brake():
    one = on_its_way(ahead=0.0, ahead_from=1.0).look().advance(LATENCY.plan - STEP)
    assert one.state.active_movement == 1


def test_a_little_less_clearance_is_no_reason_to_brake():
    one = on_its_way(ahead=0.010, ahead_from=0.0).look().advance(LATENCY.plan - STEP)
    assert one.state.active_movement == 1
    one.step()
    assert one.state.active_movement == 2


def test_a_detour_keeps_more_distance_from_new_obstacles_than_the_check():
    one = on_its_way(ahead=0.004).set(cloud=BESIDE[None]).look()
    for name, reach in (("remaining_clearance", 0.0), ("replan", NewObstacleParams().dilation)):
        aside = np.linalg.norm((one.planner.last(name).cloud - BESIDE)[:, :2], axis=1).max()
        assert aside == pytest.approx(reach, abs=1e-9)


def test_what_is_added_to_a_new_obstacle_is_no_denser_than_needed_and_leaves_no_gap():
    params, known = NewObstacleParams(), PointCloudDistance(CLOUD, extension=0.0)
    dense = BESIDE + 0.005 * np.argwhere(np.ones((12, 8, 4)))
    one = on_its_way(ahead=0.004).set(cloud=dense).look()
    cloud = one.planner.last("replan").cloud
    np.testing.assert_array_equal(cloud[: len(dense)], dense)
    wide = dilate_new_points(dense, known, X_WO.translation(), params=params)
    whole = extrude_new_points_down(wide, known, X_WO.translation(), params)
    assert len(cloud) < 0.5 * len(whole)
    kept = PointCloudDistance(cloud, extension=0.0)
    assert kept.distance(whole).max() < np.sqrt(3.0) * params.spacing


@pytest.mark.parametrize("is_still_seen", [True, False])
def test_a_retreat_keeps_off_what_was_there_once_whether_it_is_still_seen(is_still_seen):
    cloud = np.concatenate((BESIDE[None], CLOUD + 0.001)) if is_still_seen else BESIDE[None]
    one = on_its_way(ahead=0.0, ahead_from=0.0)
    one.set(cloud=cloud, predicted_cloud=BESIDE[None]).look().advance(LATENCY.plan)
    kept = one.planner.last("plan_retreat").cloud
    for point in CLOUD:
        assert np.count_nonzero(np.linalg.norm(kept - point, axis=1) < 0.005) == 1


def waiting():
    """An arm at rest that retreated, and for which there is no detour."""
    one = on_its_way(ahead=0.0, detour=NO_DETOUR)
    one.set(cloud=BESIDE[None]).look().advance(LATENCY.plan)
    assert one.state.suspended_plan is not None
    one.set(arm=ArmState(one.seen.arm.position, np.zeros(5)))
    one.planner.back = NO_DETOUR
    return one.look()


def test_what_stands_in_the_way_for_long_is_planned_around():
    one = waiting()
    one.planner.detour = path_plan()
    one.look().advance(LATENCY.plan)
    assert one.state.suspended_plan is not None
    first = one.time
    while "replan" not in one.planner.questions() or one.time == first:
        one.planner.asked.clear()
        one.look()
    assert one.time - one.state.since >= TIMING.detour_delay
    for _, seen in one.planner.asked:  # Without the undersides of what is new.
        assert len(seen.cloud) == 1
    one.advance(LATENCY.plan)
    assert one.state.plan is one.planner.detour


def test_an_arm_that_waited_looks_for_a_wider_path_than_a_narrow_one():
    one = waiting()
    wide = path_plan(clearance=0.03)
    one.planner.ahead, one.planner.reach = 0.02, wide
    one.planner.detour = path_plan(clearance=0.007)
    one.look().advance(LATENCY.plan)
    assert one.state.plan is wide
    assert one.state.suspended_plan is None


def test_an_arm_that_waited_goes_on_waiting_rather_than_by_a_very_narrow_path():
    one = waiting()
    reach = one.state.suspended_plan
    one.planner.ahead = 0.02
    one.planner.reach = one.planner.detour = path_plan(clearance=0.007)
    one.look().advance(0.3).look().advance(0.3)
    assert one.state.suspended_plan is reach


@pytest.mark.parametrize("stands", [True, False])
def test_a_narrow_path_past_what_stood_for_the_whole_wait_is_taken(stands):
    one = waiting()
    reach = one.state.suspended_plan
    one.planner.reach = one.planner.detour = path_plan(clearance=0.007)
    for step in range(round((TIMING.detour_delay + LATENCY.plan) / STEP) + 2):
        if not stands:
            one.set(predicted_cloud=BESIDE[None] + [0.0, 0.03 * step, 0.0])
        one.look()
    taken = (one.planner.detour, None) if stands else (one.state.plan, reach)
    assert (one.state.plan, one.state.suspended_plan) == taken


def test_an_arm_that_waited_looks_for_another_path_than_one_that_is_not_clear():
    one = waiting()
    one.planner.ahead, one.planner.reach = 0.02, path_plan(clearance=0.015)
    one.planner.detour = replace(path_plan(clearance=0.03), status=PlanStatus.TURNED_AWAY)
    one.look().advance(LATENCY.plan)
    assert one.state.plan is one.planner.reach
    assert one.state.suspended_plan is None


def test_what_moves_is_waited_for_and_only_then_passed():
    one = on_its_way(ahead=0.0).set(predicted_cloud=BESIDE[None])
    reach = one.state.plan
    one.look().advance(LATENCY.plan)
    assert one.state.plan is one.planner.back
    assert one.state.suspended_plan is reach
    assert "replan" not in one.planner.questions()
    for _, seen in one.planner.asked:
        np.testing.assert_array_equal(seen.cloud[len(CLOUD)], BESIDE)
    one.planner.back = NO_DETOUR  # No better place.
    one.set(arm=ArmState(one.seen.arm.position, np.zeros(5)))
    one.image_time = None
    one.advance(TIMING.detour_delay + LATENCY.plan + 2 * STEP)
    assert one.state.plan is one.planner.detour
    assert one.state.suspended_plan is None


@pytest.mark.parametrize(("moved", "stands"), [(0.0, True), (0.05, True), (0.15, False)])
def test_what_is_predicted_where_it_was_before_the_wait_stands(moved, stands):
    # The end of an arm that is too near to the camera is never measured, and predicted for ever.
    one = on_its_way(ahead=0.0).set(predicted_cloud=BESIDE[None])
    one.look().advance(LATENCY.plan)
    one.planner.back = NO_DETOUR
    there = BESIDE + [0.0, moved, 0.0]
    one.set(arm=ArmState(one.seen.arm.position, np.zeros(5)), predicted_cloud=there[None])
    while "replan" not in one.planner.questions():
        one.look()
    seen = one.planner.last("replan").cloud
    # What stands is passed as what was always there, what moves at a distance to all sides.
    sides = np.abs(seen - there).max(axis=1)
    assert np.any((sides > 0.01) & (sides < 0.06)) != stands
    assert one.time - one.state.since >= TIMING.detour_delay


def test_a_plan_that_is_not_checked_is_held_against_nothing():
    one = Supervised()
    one.planner.reach = replace(path_plan(), collision_checked=False)
    one.until(ReachMode.REACHING)
    one.planner.asked.clear()
    one.planner.ahead = 0.0
    one.advance(0.3)
    assert one.planner.asked == []
    assert one.state.active_movement == 1


def test_an_arm_on_its_way_to_where_something_is_predicted_brakes_and_goes_on_by_a_new_plan():
    one = on_its_way().look().advance(0.3)
    assert one.state.active_movement == 1
    one.set(predicted_clearance=0.001)
    assert one.step().active_movement == 0  # Within a period of the supervision.
    one.set(predicted_clearance=np.inf).look()
    one.advance(LATENCY.plan + 2.0 * STEP)
    assert one.state.mode == ReachMode.REACHING
    assert one.state.active_movement == 2


def test_the_head_looks_at_what_the_arm_waits_for():
    one = on_its_way(ahead=0.0, detour=NO_DETOUR)
    one.planner.stale = STALE
    one.set(cloud=np.concatenate((CLOUD, THING)))
    one.image_time = None
    one.advance(1.0)
    assert one.state.suspended_plan is not None
    np.testing.assert_allclose(one.state.look_at, BESIDE, atol=0.01)
    one.set(cloud=CLOUD).advance(0.2)
    np.testing.assert_allclose(one.state.look_at, BESIDE, atol=0.01)


@pytest.mark.parametrize("has_detour", [True, False])
def test_an_arm_that_waits_looks_at_what_was_not_seen_of_the_way_on(has_detour):
    """The way on is a detour, or a path planned anew where no detour is clear."""
    one = waiting()
    one.planner.ahead = 0.02
    unseen = np.array([0.7, -0.25, 0.9])
    not_seen = replace(NO_DETOUR, status=PlanStatus.NOT_SEEN, message="unseen", look_at=unseen)
    one.planner.detour, one.planner.reach = not_seen if has_detour else NO_DETOUR, not_seen
    one.look().advance(LATENCY.plan).look()
    np.testing.assert_allclose(one.state.look_at, unseen)
    assert one.state.message == not_seen.message
    # Later it is an obstacle that leaves no other path.
    one.planner.detour = one.planner.reach = NO_DETOUR
    one.advance(2.0 * TIMING.detour_delay)
    assert "unseen" not in one.state.message
