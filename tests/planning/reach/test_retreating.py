from dataclasses import replace

import numpy as np
import pytest

from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_plan import RemainingClearance
from tests.planning.reach.scripted_planner import (
    BESIDE,
    CLOUD,
    NO_DETOUR,
    P_TG,
    TIMING,
    X_WO,
    on_its_way,
    path_plan,
)

LATENCY = TIMING.latency
STEP = TIMING.time_step


def test_without_detour_the_arm_retreats_waits_and_goes_on():
    one = on_its_way(ahead=0.0, detour=NO_DETOUR)
    reach = one.state.plan
    one.look().advance(LATENCY.plan)
    assert one.state.active_movement == 2
    assert one.state.plan is one.planner.back
    assert one.state.suspended_plan is reach
    one.set(hand_position=P_TG)  # Where it waits is not where it was to arrive.
    one.look()
    one.planner.back = NO_DETOUR  # No better place.
    one.look().advance(0.3).look().advance(0.3)
    assert one.state.mode == ReachMode.REACHING
    one.planner.ahead, one.planner.detour = 0.02, path_plan()
    one.look().advance(LATENCY.plan)
    assert one.state.plan is one.planner.detour
    assert one.state.suspended_plan is None
    one.image_time = None
    one.until(ReachMode.DONE, limit=20.0)


def test_an_arm_that_retreats_does_not_brake_for_what_it_flees_from():
    one = on_its_way(ahead=0.0, ahead_from=0.0, detour=NO_DETOUR).look().advance(LATENCY.plan)
    assert one.state.plan is one.planner.back
    for _ in range(5):
        assert one.look().advance(0.15).state.active_movement > 1


def test_the_arm_does_not_retreat_to_where_something_was_that_may_come_back():
    one = on_its_way(ahead=0.0)
    one.set(cloud=CLOUD[:1], predicted_cloud=X_WO.translation()[None]).look()
    seen = one.planner.last("plan_retreat")
    assert np.linalg.norm(seen.cloud - CLOUD[1], axis=1).min() < 1e-9


def test_an_arm_that_retreats_does_not_turn_for_a_place_that_is_no_better():
    one = on_its_way(ahead=0.0).set(predicted_cloud=X_WO.translation()[None])
    one.look().advance(LATENCY.plan)
    assert one.state.movements == 2
    loss = one.planner.params.retreat.max_clearance_loss
    # Each retreat brakes first: a place that is hardly better is not worth it.
    one.planner.back = path_plan(clearance=loss - 0.001)
    one.look().advance(0.3)
    assert one.state.movements == 2
    one.planner.back = path_plan(clearance=loss + 0.001)
    one.look().advance(LATENCY.plan)
    assert one.state.movements == 3


@pytest.mark.parametrize(("better", "turns"), [(0.009, False), (0.011, True)])
def test_an_arm_that_something_is_near_goes_on_to_where_it_will_be_clear(better, turns):
    """At first it is as near on any path; what counts is the end."""
    one = on_its_way(ahead=0.0).set(predicted_cloud=X_WO.translation()[None])
    one.look().advance(LATENCY.plan)
    aside = replace(one.planner.back, clearance=0.0)
    retreating, ahead = one.state.plan, one.planner.remaining_clearance
    one.planner.remaining_clearance = lambda plan, seen: (
        RemainingClearance(np.array([0.0, 1.0]), np.array([0.0, 0.02 + better]))
        if plan is aside
        else RemainingClearance(np.array([0.0, 1.0]), np.array([0.0, 0.02]))
        if plan is retreating
        else ahead(plan, seen)
    )
    one.planner.back = aside
    one.look().advance(LATENCY.plan)
    assert (one.state.plan is aside) == turns


def test_an_arm_that_retreats_once_more_goes_on_along_the_path_on_which_it_came():
    one = on_its_way(ahead=0.0, detour=NO_DETOUR).set(predicted_cloud=X_WO.translation()[None])
    came = one.state.plan.joint_path
    one.planner.back = replace(one.planner.back, joint_path=came[41::-1])
    one.look().advance(LATENCY.plan)
    assert one.state.plan is one.planner.back
    for back in (0.2, 0.1):
        one.set(arm=ArmState(np.array([back, 0.0, 0.0, 0.0, 0.0]), np.zeros(5))).look()
        start = one.planner.last("plan_retreat").arm.position[0]
        assert abs(start - back) < 0.15  # Where the arm is when the plan takes effect.
        np.testing.assert_array_equal(one.planner.travelled, came[: round(100 * start) + 1])


def test_an_arm_on_a_detour_can_retreat_to_where_the_reach_began():
    one = on_its_way(ahead=0.004)
    reach, detour = one.state.plan, one.planner.detour
    detour = replace(detour, joint_path=detour.joint_path + [0.3, 0.0, 0.0, 0.0, 0.0])
    one.planner.detour = detour
    one.look().advance(LATENCY.plan)
    assert one.state.plan is detour
    one.planner.detour, one.planner.ahead = NO_DETOUR, 0.0
    one.set(arm=ArmState(np.array([0.6, 0.0, 0.0, 0.0, 0.0]), np.zeros(5))).look()
    start = one.planner.last("plan_retreat").arm.position[0]
    to_the_detour, along_it = reach.joint_path[:31], detour.joint_path[: round(100 * start) - 29]
    np.testing.assert_array_equal(one.planner.travelled, np.concatenate((to_the_detour, along_it)))


def test_what_comes_while_the_hand_holds_makes_it_retreat():
    one = on_its_way(detour=NO_DETOUR).set(hand_position=P_TG)
    one.image_time = None
    one.until(ReachMode.HOLDING)
    one.planner.ahead = 0.0
    one.look().advance(LATENCY.plan)
    assert one.state.mode == ReachMode.REACHING
    assert one.state.plan is one.planner.back


def test_an_arm_that_withdraws_to_where_something_is_predicted_seeks_another_place():
    one = on_its_way(ahead=0.0, ahead_from=0.0).set(predicted_cloud=BESIDE[None]).look()
    one.advance(LATENCY.plan + STEP)
    assert one.state.suspended_plan is not None
    retreats = one.planner.questions().count("plan_retreat")
    one.set(predicted_clearance=0.001)
    assert one.step().active_movement == 0
    one.set(predicted_clearance=np.inf).look().advance(LATENCY.plan + 2.0 * STEP)
    assert one.planner.questions().count("plan_retreat") > retreats
    assert one.state.active_movement > 2
    assert one.state.mode == ReachMode.REACHING
