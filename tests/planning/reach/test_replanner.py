from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud

from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_planner import PlanStatus
from pepper_drake.planning.trajectories.retreat import NEWCOMER_SIDE
from tests.systems.reach_rig import (
    CLOUD,
    P_TG,
    TIMING,
    X_WO,
    Blocked,
    blocked,
    plan,
    settled,
    way,
)


def test_the_way_ahead_is_looked_at_once_for_each_cloud():
    rig = blocked()
    rig.planner.asked.clear()
    for time in (0.3, 0.5):
        rig.set(cloud_time=[time])
        rig.advance(0.3)
    looks = [seen for name, seen in rig.planner.asked if name == "remaining_clearance"]
    assert len(looks) == 2
    np.testing.assert_array_equal(looks[0]["joint_position"][:5], 0.1 * np.ones(5))
    assert not any(name == "replan" for name, _ in rig.planner.asked)


def test_a_plan_that_is_not_vetted_is_held_against_nothing():
    rig = settled(Blocked(reach=replace(way(), collision_checked=False)))
    rig.set(arm_position_command=0.1 * np.ones(5), arm_velocity_command=0.2 * np.ones(5))
    rig.planner.ahead = 0.0
    rig.set(cloud_time=[0.4])
    rig.advance(0.3)
    assert rig.planner.asked == []
    assert rig.value("movement").id == 1


def test_what_comes_in_the_way_makes_another_movement():
    rig = blocked()
    assert rig.value("movement").id == 1
    rig.planner.ahead = 0.004
    rig.set(cloud_time=[0.4])
    rig.advance(0.1)
    assert rig.value("movement").id == 2
    assert rig.progress.plan is rig.planner.detour
    ((_, seen),) = [asked for asked in rig.planner.asked if asked[0] == "replan"]
    np.testing.assert_array_equal(seen["joint_velocity"], 0.2 * np.ones(5))


def test_without_another_way_the_arm_withdraws_waits_and_goes_on():
    rig = blocked()
    way = rig.progress.plan
    rig.planner.ahead = 0.0
    rig.planner.detour = plan(PlanStatus.NO_CLEAR_PATH, "no way")
    rig.set(cloud_time=[0.4])
    rig.advance(0.1)
    assert rig.value("movement").id == 2
    assert rig.progress.plan is rig.planner.back
    assert rig.progress.suspended_plan is way
    rig.set(hand_pose=RigidTransform(P_TG))  # Where it waits is not where it was to arrive.
    rig.advance(3.0)
    assert rig.progress.mode == ReachMode.REACHING
    rig.planner.ahead, rig.planner.detour = 0.02, Blocked.detour
    rig.set(cloud_time=[0.6])
    rig.advance(0.1)
    assert rig.value("movement").id == 3
    assert rig.progress.suspended_plan is None
    rig.until(ReachMode.DONE)


def test_a_way_around_what_is_new_keeps_off_it_more_than_the_way_ahead_is_asked_to():
    rig = blocked()
    rig.planner.asked.clear()
    rig.planner.ahead = 0.004
    new = X_WO.translation() + [0.1, 0.2, 0.1]
    rig.set(cloud_time=[0.4], cloud=cloud_at(new))
    rig.advance(0.1)
    seen = {name: seen["cloud_W"] for name, seen in rig.planner.asked}
    for name, reach in (("remaining_clearance", 0.0), ("replan", NEWCOMER_SIDE)):
        aside = np.linalg.norm((seen[name] - new)[:, :2], axis=1).max()
        assert aside == pytest.approx(reach, abs=1e-6)


def test_what_stands_in_the_way_for_long_is_known_and_planned_around():
    rig = blocked()
    rig.planner.ahead = 0.0
    rig.planner.detour = plan(PlanStatus.NO_CLEAR_PATH, "no way")
    rig.set(cloud_time=[0.4], cloud=cloud_at(X_WO.translation() + [0.1, 0.2, 0.1]))
    rig.advance(0.1)
    assert rig.progress.suspended_plan is not None
    rig.planner.detour = Blocked.detour
    rig.set(cloud_time=[0.6])
    rig.advance(0.1)
    assert rig.progress.suspended_plan is not None
    rig.advance(TIMING.detour_delay)
    rig.planner.asked.clear()
    rig.set(cloud_time=[0.8])
    rig.advance(0.1)
    assert rig.progress.plan is rig.planner.detour
    for _, seen in rig.planner.asked:  # Without the undersides of what is new.
        assert len(seen["cloud_W"]) == 1


def waiting():
    """An arm at rest that stepped aside, and for which there is no way on."""
    rig = blocked()
    rig.planner.ahead = 0.0
    rig.planner.detour = plan(PlanStatus.NO_CLEAR_PATH, "no way")
    rig.set(cloud_time=[0.4], arm_velocity_command=np.zeros(5))
    rig.advance(0.1)
    return rig


def test_an_arm_that_waited_looks_for_a_better_way_than_a_narrow_one():
    rig = waiting()
    wide = replace(Blocked.detour, clearance=0.03)
    rig.planner.ahead, rig.planner.reach = 0.02, wide
    rig.planner.detour = replace(Blocked.detour, clearance=0.007)
    rig.set(cloud_time=[0.6])
    rig.advance(0.1)
    assert rig.progress.plan is wide
    assert rig.progress.suspended_plan is None


def test_an_arm_that_waited_goes_on_waiting_rather_than_by_a_very_narrow_way():
    rig = waiting()
    reach = rig.progress.suspended_plan
    assert reach is not None
    rig.planner.ahead = 0.02
    narrow = replace(Blocked.detour, clearance=0.007)
    rig.planner.reach, rig.planner.detour = narrow, narrow
    rig.set(cloud_time=[0.6])
    rig.advance(0.1)
    assert rig.progress.suspended_plan is reach


def cloud_at(point):
    cloud = PointCloud(1)
    cloud.mutable_xyzs()[:] = np.reshape(point, (3, 1))
    return cloud


def test_what_moves_is_waited_for_and_only_then_passed():
    rig = blocked()
    way = rig.progress.plan
    rig.planner.asked.clear()
    rig.planner.ahead = 0.0
    predicted_points = X_WO.translation() + [0.1, 0.2, 0.1]
    rig.set(cloud_time=[0.4], predicted_cloud=cloud_at(predicted_points))
    rig.advance(0.1)
    assert rig.progress.plan is rig.planner.back
    assert rig.progress.suspended_plan is way
    assert not any(name == "replan" for name, _ in rig.planner.asked)
    for _, seen in rig.planner.asked:
        np.testing.assert_allclose(seen["cloud_W"][len(CLOUD)], predicted_points, atol=1e-6)
    rig.advance(TIMING.detour_delay)
    rig.set(cloud_time=[0.6])
    rig.advance(0.1)
    assert rig.progress.plan is rig.planner.detour
    assert rig.progress.suspended_plan is None


def test_the_arm_does_not_withdraw_to_where_something_was_that_may_come_back():
    rig = blocked()
    rig.planner.asked.clear()
    rig.planner.ahead = 0.0
    predicted_points = X_WO.translation()
    left = PointCloud(1)
    left.mutable_xyzs()[:] = CLOUD[:1].T
    rig.set(cloud_time=[0.4], cloud=left, predicted_cloud=cloud_at(predicted_points))
    rig.advance(0.1)
    ((_, seen),) = [asked for asked in rig.planner.asked if asked[0] == "plan_retreat"]
    off = np.linalg.norm(seen["cloud_W"] - CLOUD[1], axis=1)
    assert off.min() < 1e-6


def test_what_moves_far_away_does_not_matter():
    rig = blocked()
    rig.planner.asked.clear()
    rig.planner.ahead = 0.0
    rig.set(cloud_time=[0.4], predicted_cloud=cloud_at(X_WO.translation() + [0.5, 0.5, 0.0]))
    rig.advance(0.1)
    assert rig.progress.plan is rig.planner.detour


def test_who_withdraws_does_not_turn_for_a_place_that_is_no_better():
    rig = blocked()
    rig.planner.ahead = 0.0
    rig.set(cloud_time=[0.4], predicted_cloud=cloud_at(X_WO.translation()))
    rig.advance(0.1)
    number = rig.progress.movements
    rig.planner.back = replace(rig.planner.back, clearance=0.0)
    rig.set(cloud_time=[0.6])
    rig.advance(0.1)
    assert rig.progress.movements == number
    rig.planner.back = replace(rig.planner.back, clearance=0.01)
    rig.set(cloud_time=[0.8])
    rig.advance(0.1)
    assert rig.progress.movements == number + 1


def test_what_stays_in_the_way_is_named_in_the_end():
    rig = blocked()
    rig.planner.ahead = 0.0
    rig.planner.detour = plan(PlanStatus.NO_CLEAR_PATH, "no way")
    rig.set(cloud_time=[0.4])
    rig.until(ReachMode.FAILED, limit=40.0)
    assert rig.progress.reason == "no_clear_path"
    assert rig.context.get_time() > TIMING.blocked_timeout


def test_what_comes_while_the_hand_holds_makes_it_withdraw():
    rig = blocked()
    rig.set(hand_pose=RigidTransform(P_TG))
    rig.until(ReachMode.HOLDING)
    rig.planner.ahead = 0.0
    rig.planner.detour = plan(PlanStatus.NO_CLEAR_PATH, "no way")
    rig.set(cloud_time=[4.0])
    rig.advance(0.1)
    assert rig.progress.mode == ReachMode.REACHING
    assert rig.progress.plan is rig.planner.back
