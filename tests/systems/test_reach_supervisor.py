import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.perception.mapping.depth_validity import DepthFault
from pepper_drake.planning.ik.command_check import StopReason
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_planner import PlanStatus
from pepper_drake.systems.reach_supervisor import head_search_pattern
from tests.systems.reach_rig import (
    ADAPTED,
    CLOUD,
    P_TG,
    SHOWN,
    STAND,
    TIMING,
    X_WO,
    Blocked,
    FakePlanner,
    Rig,
    plan,
    settled,
    way,
)


def test_the_whole_reach_when_all_goes_well():
    rig = Rig()
    np.testing.assert_array_equal(rig.value("base_goal"), np.full(3, np.nan))
    rig.until(ReachMode.DRIVING)
    np.testing.assert_array_equal(rig.value("base_goal"), STAND)
    rig.until(ReachMode.REACHING)
    assert rig.value("movement").id == 1
    rig.advance(0.5)
    rig.set(hand_pose=RigidTransform(P_TG + np.array([0.002, 0, 0])))
    rig.until(ReachMode.DONE)
    assert rig.value("movement").id == 1
    assert rig.modes == list(ReachMode)[: ReachMode.DONE + 1]
    assert rig.progress.reason == rig.progress.message == ""


def test_each_mode_lasts_as_long_as_its_timing_says():
    rig = Rig().until(ReachMode.DRIVING)
    # Seen at the tick of 0, then looked at for 0.5 s.
    assert rig.progress.since == pytest.approx(TIMING.looking)
    driving = rig.progress.since
    rig.until(ReachMode.SETTLING)
    assert rig.progress.since - driving <= 0.1 + 1e-9
    settling = rig.progress.since
    rig.until(ReachMode.REACHING)
    assert rig.progress.since - settling == pytest.approx(TIMING.settling)
    rig.set(hand_pose=RigidTransform(P_TG))
    reaching = rig.progress.since
    rig.until(ReachMode.HOLDING)
    # The whole duration of the primitive, and a hand that stays there for 0.2 s.
    assert rig.progress.since - reaching == pytest.approx(1.0 + 0.2, abs=0.051)
    holding = rig.progress.since
    rig.until(ReachMode.DONE)
    assert rig.progress.since - holding == pytest.approx(TIMING.holding)


def test_the_planner_is_asked_with_what_was_measured_and_seen():
    rig = Rig().until(ReachMode.REACHING)
    assert [name for name, _ in rig.planner.asked] == ["plan_base_placement", "check_reach"]
    for _, arguments in rig.planner.asked:
        np.testing.assert_array_equal(arguments["base_pose"], [0.1, 0.2, 0.3])
        np.testing.assert_array_equal(arguments["joint_position"], np.arange(15) / 100)
        np.testing.assert_allclose(arguments["cloud_W"], CLOUD, atol=1e-6)
        assert arguments["X_WO"].IsExactlyEqualTo(X_WO)


def test_a_goal_that_is_never_seen():
    rig = Rig()
    rig.set(goal_valid=[0.0], goal_age=[np.inf])
    rig.failed("goal_not_seen")
    assert rig.progress.since == pytest.approx(TIMING.goal_timeout, abs=0.051)
    assert not rig.was_active
    assert rig.planner.asked == []


@pytest.mark.parametrize("cloud_time", [np.nan, -np.inf, np.inf])
def test_a_cloud_that_never_comes(cloud_time):
    rig = Rig()
    rig.set(cloud_time=[cloud_time])
    rig.failed("cloud_missing")
    assert not rig.was_active
    assert rig.planner.asked == []


@pytest.mark.parametrize(
    "mode", [ReachMode.DRIVING, ReachMode.SETTLING, ReachMode.REACHING, ReachMode.HOLDING]
)
@pytest.mark.parametrize("age", [0.6, np.inf, np.nan])
def test_a_cloud_that_grows_old_ends_every_mode(mode, age):
    rig = Rig()
    rig.set(cloud_age=[0.4], cloud_fault=[DepthFault.NONE], arrived=[0.0])
    rig.until(ReachMode.DRIVING)
    if mode != ReachMode.DRIVING:
        rig.set(arrived=[1.0])
    if mode == ReachMode.HOLDING:
        rig.set(hand_pose=RigidTransform(P_TG))
    rig.until(mode)
    rig.set(cloud_age=[age], cloud_fault=[DepthFault.FROZEN])
    rig.advance(0.1).failed("cloud_missing")
    assert "same image" in rig.progress.message
    assert rig.value("active") == [0.0]
    assert np.isnan(rig.value("base_goal")).all()


def test_nothing_begins_on_an_old_cloud():
    rig = Rig()
    rig.set(cloud_age=[0.6], cloud_fault=[DepthFault.BLANK])
    rig.failed("cloud_missing")
    assert rig.modes == [ReachMode.LOOKING, ReachMode.FAILED]
    assert not rig.was_active
    assert "nothing at all" in rig.progress.message


def test_a_cloud_that_comes_late_is_waited_for():
    rig = Rig()
    rig.set(cloud_time=[-np.inf])
    rig.advance(0.8)
    assert rig.progress.mode == ReachMode.LOOKING
    rig.set(cloud_time=[0.8])
    rig.until(ReachMode.DRIVING)


@pytest.mark.parametrize(
    "status",
    [PlanStatus.OUT_OF_REACH, PlanStatus.NO_CLEAR_PATH, PlanStatus.NO_STANDING_ROOM],
)
@pytest.mark.parametrize("when", ["stand", "reach"])
def test_a_reach_that_the_planner_refuses_never_starts(status, when):
    rig = Rig(FakePlanner(**{when: plan(status, "the planner's own words")}))
    rig.failed(status.value)
    assert rig.progress.message == "the planner's own words"
    assert not rig.was_active
    assert (ReachMode.DRIVING in rig.modes) == (when == "reach")


def test_a_base_that_does_not_arrive():
    rig = Rig()
    rig.set(arrived=[0.0])
    rig.failed("drive_failed")
    assert not rig.was_active


@pytest.mark.parametrize("mode", [m for m in ReachMode if m < ReachMode.DONE])
@pytest.mark.parametrize("reason", [r for r in StopReason if r != StopReason.NONE])
def test_a_stop_ends_every_mode_and_switches_the_arm_off(mode, reason):
    rig = Rig()
    rig.set(hand_pose=RigidTransform(P_TG))
    rig.until(mode)
    rig.set(stop_reason=[float(reason)])
    rig.failed(reason.name.lower())
    rig.set(stop_reason=[float(StopReason.NONE)])
    rig.advance(0.5).failed(reason.name.lower())


@pytest.mark.parametrize("mode", [ReachMode.DRIVING, ReachMode.REACHING])
def test_a_goal_that_was_not_seen_for_long_is_lost(mode):
    rig = Rig()
    rig.set(arrived=[float(mode != ReachMode.DRIVING)])
    rig.until(mode)
    rig.set(goal_age=[TIMING.goal_lost - 0.01])
    rig.advance(0.1)
    assert rig.progress.mode == mode
    rig.set(goal_age=[TIMING.goal_lost + 0.01])
    rig.failed("goal_lost")


def test_a_hand_that_stays_away_from_its_goal():
    rig = Rig().until(ReachMode.REACHING)
    rig.set(hand_pose=RigidTransform(P_TG + np.array([0.0, 0.03, 0.04])))
    rig.failed("not_reached")
    assert "50 mm" in rig.progress.message


def test_a_hand_just_outside_the_tolerance_is_accepted_when_the_time_is_over():
    rig = Rig().until(ReachMode.REACHING)
    between = (TIMING.position_tolerance + TIMING.accepted_position) / 2
    rig.set(hand_pose=RigidTransform(P_TG + np.array([between, 0, 0])))
    rig.advance(TIMING.reaching_timeout - 0.1)
    assert rig.progress.mode == ReachMode.REACHING
    rig.until(ReachMode.DONE)


def test_a_hand_that_only_passes_the_goal_does_not_count_as_there():
    rig = Rig().until(ReachMode.REACHING)
    rig.advance(1.1)
    rig.set(hand_pose=RigidTransform(P_TG))
    rig.advance(0.1)
    rig.set(hand_pose=RigidTransform(P_TG + np.array([0.05, 0, 0])))
    rig.advance(0.3)
    assert rig.progress.mode == ReachMode.REACHING
    rig.failed("not_reached")


def test_what_is_over_stays_over():
    rig = Rig()
    rig.set(hand_pose=RigidTransform(P_TG))
    rig.until(ReachMode.DONE)
    rig.set(stop_reason=[float(StopReason.REQUESTED)], goal_age=[100.0])
    rig.advance(0.5)
    assert rig.progress.mode == ReachMode.DONE


def test_two_contexts_do_not_share_their_progress():
    rig = Rig().until(ReachMode.SETTLING)
    clone = rig.context.Clone()
    before = rig.supervisor.progress(clone)
    rig.until(ReachMode.REACHING)
    assert rig.supervisor.progress(clone) == before
    assert rig.supervisor.progress(rig.supervisor.CreateDefaultContext()).mode == ReachMode.LOOKING


def test_nothing_is_fed_through():
    assert not Rig().supervisor.HasAnyDirectFeedthrough()


def test_the_search_begins_ahead_and_sweeps_to_both_sides_without_a_jump():
    times = np.arange(0, 12, 0.05)
    gaze = np.array([head_search_pattern(time) for time in times])
    assert np.all(gaze[times <= 1.5, 0] == 0)
    assert gaze[:, 0].max() > 0.9
    assert gaze[:, 0].min() < -0.9
    # The head turns with at most 1.2 rad/s, of its rated 7.3.
    assert np.abs(np.diff(gaze[:, 0])).max() < 1.2 * 0.05
    rig = Rig().advance(3.0)
    np.testing.assert_array_equal(rig.value("resting_head"), head_search_pattern(3.0))


def test_the_planned_movement_is_known_a_tick_before_it_begins():
    rig = Rig()
    before = None
    while rig.progress.mode != ReachMode.REACHING:
        before = rig.value("movement")
        rig.advance(0.05)
    assert before.id == 0
    assert before.primitive is ADAPTED.primitive
    assert before.coupling is None
    np.testing.assert_array_equal(before.X_OG.translation(), [0, 0, 0.1])
    assert rig.value("movement").id == 1


def test_before_the_plan_it_is_the_movement_that_was_shown():
    rig = Rig()
    assert rig.value("movement").primitive is SHOWN.primitive
    assert rig.value("movement").coupling is SHOWN.coupling


def test_a_plan_is_confirmed_by_the_last_look_before_the_arm_starts():
    rig = settled(Blocked(reach=way()))
    assert [name for name, _ in rig.planner.asked] == ["remaining_clearance"]
    assert rig.progress.planning_seconds < 0.1


def test_a_goal_that_moved_meanwhile_is_planned_for_anew():
    moved = RigidTransform(X_WO.translation() + [0.0, 0.01, 0.0])
    rig = settled(Blocked(reach=way()), object_pose=moved)
    assert [name for name, _ in rig.planner.asked] == ["check_reach", "remaining_clearance"]


def test_what_the_last_look_shows_in_the_way_is_planned_around():
    planner = Blocked(reach=way())
    looks = iter([0.0, 0.02, 0.02, 0.02])
    planner.remaining_clearance = lambda plan, **seen: next(looks)
    rig = settled(planner)
    assert [name for name, _ in rig.planner.asked] == ["check_reach"]
