from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.reach_setup import make_primitive
from pepper_drake.learning.coupling import BarrierCoupling
from pepper_drake.planning.command_check import StopReason
from pepper_drake.planning.control_model import BODY_JOINTS
from pepper_drake.planning.movement import Movement
from pepper_drake.planning.reach_planner import ReachPlan, ReachVerdict
from pepper_drake.planning.withdrawal import NEWCOMER_SIDE
from pepper_drake.systems.reach_mode import ReachMode
from pepper_drake.systems.reach_progress import ReachTiming
from pepper_drake.systems.reach_supervisor import ReachSupervisor, search_gaze

STAND = np.array([0.55, -0.05, 0.1])
X_WO = RigidTransform([0.98, -0.11, 0.74])
P_TG = np.array([0.26, -0.2, 0.05])
CLOUD = np.array([[0.9, 0.0, 0.7], [1.0, 0.1, 0.7]])

TIMING = ReachTiming(
    looking=0.5,
    goal_timeout=1.0,
    driving_timeout=2.0,
    settling=0.4,
    goal_lost=3.0,
    holding=0.5,
    reaching_timeout=2.0,
)


SHOWN = Movement(make_primitive(None, "right"), BarrierCoupling(), RigidTransform())
ADAPTED = Movement(make_primitive(None, "left"), None, RigidTransform([0, 0, 0.1]))


def plan(verdict=ReachVerdict.CLEAR, sentence=""):
    return ReachPlan(verdict, sentence, STAND, movement=ADAPTED)


@dataclass
class FakePlanner:
    """Says what it is told to, and keeps what it was asked."""

    stand: ReachPlan = field(default_factory=plan)
    reach: ReachPlan = field(default_factory=plan)
    asked: list = field(default_factory=list)
    shown: Movement = SHOWN

    def plan_stand(self, **arguments):
        self.asked.append(("plan_stand", arguments))
        return self.stand

    def check_reach(self, **arguments):
        self.asked.append(("check_reach", arguments))
        return self.reach


class Rig:
    """A supervisor whose inputs are set by hand; all is well until something is changed."""

    def __init__(self, planner=None):
        self.planner = planner or FakePlanner()
        self.supervisor = ReachSupervisor(self.planner, TIMING)
        self.simulator = Simulator(self.supervisor)
        self.context = self.simulator.get_mutable_context()
        cloud = PointCloud(len(CLOUD))
        cloud.mutable_xyzs()[:] = CLOUD.T
        self.set(
            object_pose=X_WO,
            cloud=cloud,
            hand_pose=RigidTransform(),
            goal_valid=[1.0],
            goal_age=[0.1],
            goal_position=P_TG,
            cloud_time=[0.1],
            joint_position=np.arange(len(BODY_JOINTS)) / 100,
            base_pose=[0.1, 0.2, 0.3],
            arrived=[1.0],
            tau=[1.0],
            stop_reason=[float(StopReason.NONE)],
        )
        self.was_active = False
        self.modes = [ReachMode.LOOKING]
        self.simulator.set_monitor(self._watch)

    def _watch(self, root):
        self.was_active |= self.value("active")[0] > 0.5
        mode = ReachMode(int(self.value("mode")[0]))
        if mode != self.modes[-1]:
            self.modes.append(mode)

    def set(self, **inputs):
        for name, value in inputs.items():
            self.supervisor.GetInputPort(name).FixValue(self.context, value)

    def value(self, name):
        return self.supervisor.GetOutputPort(name).Eval(self.context)

    @property
    def progress(self):
        return self.supervisor.progress(self.context)

    def advance(self, duration):
        self.simulator.AdvanceTo(self.context.get_time() + duration)
        return self

    def until(self, mode, limit=10.0):
        while self.progress.mode != mode and self.context.get_time() < limit:
            self.advance(0.05)
        assert self.progress.mode == mode, self.progress
        return self

    def failed(self, reason):
        self.until(ReachMode.FAILED)
        assert self.progress.reason == reason
        assert self.progress.sentence
        np.testing.assert_array_equal(self.value("active"), [0.0])
        return self


def test_the_whole_reach_when_all_goes_well():
    rig = Rig()
    np.testing.assert_array_equal(rig.value("base_goal"), np.full(3, np.nan))
    rig.until(ReachMode.DRIVING)
    np.testing.assert_array_equal(rig.value("base_goal"), STAND)
    rig.until(ReachMode.REACHING)
    np.testing.assert_array_equal(rig.value("active"), [1.0])
    rig.advance(0.5)
    rig.set(hand_pose=RigidTransform(P_TG + np.array([0.002, 0, 0])))
    rig.until(ReachMode.DONE)
    np.testing.assert_array_equal(rig.value("active"), [1.0])
    assert rig.modes == list(ReachMode)[: ReachMode.DONE + 1]
    assert rig.progress.reason == rig.progress.sentence == ""


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
    assert [name for name, _ in rig.planner.asked] == ["plan_stand", "check_reach"]
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


def test_a_cloud_that_comes_late_is_waited_for():
    rig = Rig()
    rig.set(cloud_time=[-np.inf])
    rig.advance(0.8)
    assert rig.progress.mode == ReachMode.LOOKING
    rig.set(cloud_time=[0.8])
    rig.until(ReachMode.DRIVING)


@pytest.mark.parametrize(
    "verdict",
    [ReachVerdict.OUT_OF_REACH, ReachVerdict.NO_CLEAR_PATH, ReachVerdict.NO_STANDING_ROOM],
)
@pytest.mark.parametrize("when", ["stand", "reach"])
def test_a_reach_that_the_planner_refuses_never_starts(verdict, when):
    rig = Rig(FakePlanner(**{when: plan(verdict, "the planner's own words")}))
    rig.failed(verdict.value)
    assert rig.progress.sentence == "the planner's own words"
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
    assert "50 mm" in rig.progress.sentence


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
    gaze = np.array([search_gaze(time) for time in times])
    assert np.all(gaze[times <= 1.5, 0] == 0)
    assert gaze[:, 0].max() > 0.9
    assert gaze[:, 0].min() < -0.9
    # The head turns with at most 1.2 rad/s, of its rated 7.3.
    assert np.abs(np.diff(gaze[:, 0])).max() < 1.2 * 0.05
    rig = Rig().advance(3.0)
    np.testing.assert_array_equal(rig.value("resting_head"), search_gaze(3.0))


def test_the_planned_movement_is_known_a_tick_before_it_begins():
    rig = Rig()
    before = {}
    while rig.progress.mode != ReachMode.REACHING:
        names = ("primitive", "coupling_law", "X_OG", "active")
        before = {name: rig.value(name) for name in names}
        rig.advance(0.05)
    assert before["active"][0] == 0.0
    assert before["primitive"] is ADAPTED.primitive
    assert before["coupling_law"] is None
    np.testing.assert_array_equal(before["X_OG"].translation(), [0, 0, 0.1])
    assert rig.value("active")[0] == 1.0


def test_before_the_plan_it_is_the_movement_that_was_shown():
    rig = Rig()
    assert rig.value("primitive") is SHOWN.primitive
    assert rig.value("coupling_law") is SHOWN.coupling


class Blocked(FakePlanner):
    """A planner to whom the way ahead is blocked once the arm is on its way."""

    arm_in_body = np.arange(5)
    ahead = 0.02
    detour = ReachPlan(
        ReachVerdict.CLEAR, "", STAND, clearance=0.02, joint_path=np.zeros((9, 5)), movement=SHOWN
    )

    back = ReachPlan(
        ReachVerdict.OUT_OF_REACH,
        "",
        STAND,
        clearance=0.05,
        joint_path=np.ones((9, 5)),
        movement=SHOWN,
    )

    def withdraw(self, plan, **seen):
        self.asked.append(("withdraw", seen))
        return self.back

    def clearance_ahead(self, plan, **seen):
        self.asked.append(("clearance_ahead", seen))
        return self.ahead

    def replan(self, plan, **seen):
        self.asked.append(("replan", seen))
        return self.detour


def blocked():
    way = ReachPlan(
        ReachVerdict.CLEAR, "", STAND, clearance=0.02, joint_path=np.ones((9, 5)), movement=SHOWN
    )
    rig = Rig(Blocked(reach=way))
    rig.set(arm_position_command=0.1 * np.ones(5), arm_velocity_command=0.2 * np.ones(5))
    return rig.until(ReachMode.REACHING).advance(0.1)


def test_the_way_ahead_is_looked_at_once_for_each_cloud():
    rig = blocked()
    rig.planner.asked.clear()
    for time in (0.3, 0.5):
        rig.set(cloud_time=[time])
        rig.advance(0.3)
    looks = [seen for name, seen in rig.planner.asked if name == "clearance_ahead"]
    assert len(looks) == 2
    np.testing.assert_array_equal(looks[0]["joint_position"][:5], 0.1 * np.ones(5))
    assert not any(name == "replan" for name, _ in rig.planner.asked)


def test_a_plan_that_is_not_vetted_is_held_against_nothing():
    rig = settled(Blocked(reach=replace(way(), vetted=False)))
    rig.set(arm_position_command=0.1 * np.ones(5), arm_velocity_command=0.2 * np.ones(5))
    rig.planner.ahead = 0.0
    rig.set(cloud_time=[0.4])
    rig.advance(0.3)
    assert rig.planner.asked == []
    np.testing.assert_array_equal(rig.value("active"), [1.0])


def test_what_comes_in_the_way_makes_another_movement():
    rig = blocked()
    np.testing.assert_array_equal(rig.value("active"), [1.0])
    rig.planner.ahead = 0.004
    rig.set(cloud_time=[0.4])
    rig.advance(0.1)
    np.testing.assert_array_equal(rig.value("active"), [2.0])
    assert rig.progress.plan is rig.planner.detour
    ((_, seen),) = [asked for asked in rig.planner.asked if asked[0] == "replan"]
    np.testing.assert_array_equal(seen["joint_velocity"], 0.2 * np.ones(5))


def test_without_another_way_the_arm_withdraws_waits_and_goes_on():
    rig = blocked()
    way = rig.progress.plan
    rig.planner.ahead = 0.0
    rig.planner.detour = plan(ReachVerdict.NO_CLEAR_PATH, "no way")
    rig.set(cloud_time=[0.4])
    rig.advance(0.1)
    np.testing.assert_array_equal(rig.value("active"), [2.0])
    assert rig.progress.plan is rig.planner.back
    assert rig.progress.blocked is way
    rig.set(hand_pose=RigidTransform(P_TG))  # Where it waits is not where it was to arrive.
    rig.advance(3.0)
    assert rig.progress.mode == ReachMode.REACHING
    rig.planner.ahead, rig.planner.detour = 0.02, Blocked.detour
    rig.set(cloud_time=[0.6])
    rig.advance(0.1)
    np.testing.assert_array_equal(rig.value("active"), [3.0])
    assert rig.progress.blocked is None
    rig.until(ReachMode.DONE)


def test_a_way_around_what_is_new_keeps_off_it_more_than_the_way_ahead_is_asked_to():
    rig = blocked()
    rig.planner.asked.clear()
    rig.planner.ahead = 0.004
    new = X_WO.translation() + [0.1, 0.2, 0.1]
    rig.set(cloud_time=[0.4], cloud=cloud_at(new))
    rig.advance(0.1)
    seen = {name: seen["cloud_W"] for name, seen in rig.planner.asked}
    for name, reach in (("clearance_ahead", 0.0), ("replan", NEWCOMER_SIDE)):
        aside = np.linalg.norm((seen[name] - new)[:, :2], axis=1).max()
        assert aside == pytest.approx(reach, abs=1e-6)


def test_what_stands_in_the_way_for_long_is_known_and_planned_around():
    rig = blocked()
    rig.planner.ahead = 0.0
    rig.planner.detour = plan(ReachVerdict.NO_CLEAR_PATH, "no way")
    rig.set(cloud_time=[0.4], cloud=cloud_at(X_WO.translation() + [0.1, 0.2, 0.1]))
    rig.advance(0.1)
    assert rig.progress.blocked is not None
    rig.planner.detour = Blocked.detour
    rig.set(cloud_time=[0.6])
    rig.advance(0.1)
    assert rig.progress.blocked is not None
    rig.advance(TIMING.stepping_aside)
    rig.planner.asked.clear()
    rig.set(cloud_time=[0.8])
    rig.advance(0.1)
    assert rig.progress.plan is rig.planner.detour
    for _, seen in rig.planner.asked:  # Without the undersides of what is new.
        assert len(seen["cloud_W"]) == 1


def test_an_arm_that_waited_looks_for_a_better_way_than_a_narrow_one():
    rig = blocked()
    rig.planner.ahead = 0.0
    rig.planner.detour = plan(ReachVerdict.NO_CLEAR_PATH, "no way")
    rig.set(cloud_time=[0.4], arm_velocity_command=np.zeros(5))
    rig.advance(0.1)
    wide = replace(Blocked.detour, clearance=0.03)
    rig.planner.ahead, rig.planner.reach = 0.02, wide
    rig.planner.detour = replace(Blocked.detour, clearance=0.007)
    rig.set(cloud_time=[0.6])
    rig.advance(0.1)
    assert rig.progress.plan is wide
    assert rig.progress.blocked is None


def cloud_at(point):
    cloud = PointCloud(1)
    cloud.mutable_xyzs()[:] = np.reshape(point, (3, 1))
    return cloud


def test_what_moves_is_waited_for_and_only_then_passed():
    rig = blocked()
    way = rig.progress.plan
    rig.planner.asked.clear()
    rig.planner.ahead = 0.0
    coming = X_WO.translation() + [0.1, 0.2, 0.1]
    rig.set(cloud_time=[0.4], approaching=cloud_at(coming))
    rig.advance(0.1)
    assert rig.progress.plan is rig.planner.back
    assert rig.progress.blocked is way
    assert not any(name == "replan" for name, _ in rig.planner.asked)
    for _, seen in rig.planner.asked:
        np.testing.assert_allclose(seen["cloud_W"][len(CLOUD)], coming, atol=1e-6)
    rig.advance(TIMING.stepping_aside)
    rig.set(cloud_time=[0.6])
    rig.advance(0.1)
    assert rig.progress.plan is rig.planner.detour
    assert rig.progress.blocked is None


def test_the_arm_does_not_withdraw_to_where_something_was_that_may_come_back():
    rig = blocked()
    rig.planner.asked.clear()
    rig.planner.ahead = 0.0
    coming = X_WO.translation()
    left = PointCloud(1)
    left.mutable_xyzs()[:] = CLOUD[:1].T
    rig.set(cloud_time=[0.4], cloud=left, approaching=cloud_at(coming))
    rig.advance(0.1)
    ((_, seen),) = [asked for asked in rig.planner.asked if asked[0] == "withdraw"]
    off = np.linalg.norm(seen["cloud_W"] - CLOUD[1], axis=1)
    assert off.min() < 1e-6


def test_what_moves_far_away_does_not_matter():
    rig = blocked()
    rig.planner.asked.clear()
    rig.planner.ahead = 0.0
    rig.set(cloud_time=[0.4], approaching=cloud_at(X_WO.translation() + [0.5, 0.5, 0.0]))
    rig.advance(0.1)
    assert rig.progress.plan is rig.planner.detour


def test_who_withdraws_does_not_turn_for_a_place_that_is_no_better():
    rig = blocked()
    rig.planner.ahead = 0.0
    rig.set(cloud_time=[0.4], approaching=cloud_at(X_WO.translation()))
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
    rig.planner.detour = plan(ReachVerdict.NO_CLEAR_PATH, "no way")
    rig.set(cloud_time=[0.4])
    rig.until(ReachMode.FAILED, limit=40.0)
    assert rig.progress.reason == "no_clear_path"
    assert rig.context.get_time() > TIMING.patience


def test_what_comes_while_the_hand_holds_makes_it_withdraw():
    rig = blocked()
    rig.set(hand_pose=RigidTransform(P_TG))
    rig.until(ReachMode.HOLDING)
    rig.planner.ahead = 0.0
    rig.planner.detour = plan(ReachVerdict.NO_CLEAR_PATH, "no way")
    rig.set(cloud_time=[4.0])
    rig.advance(0.1)
    assert rig.progress.mode == ReachMode.REACHING
    assert rig.progress.plan is rig.planner.back


def settled(planner, **changes):
    """A rig on its way through SETTLING, changed after the first plan was made."""
    rig = Rig(planner).until(ReachMode.SETTLING)
    rig.advance(0.3)
    assert [name for name, _ in planner.asked][-1] == "check_reach"
    rig.set(**changes)
    planner.asked.clear()
    return rig.until(ReachMode.REACHING)


def way():
    return ReachPlan(
        ReachVerdict.CLEAR, "", STAND, clearance=0.02, joint_path=np.ones((9, 5)), movement=SHOWN
    )


def test_a_plan_is_confirmed_by_the_last_look_before_the_arm_starts():
    rig = settled(Blocked(reach=way()))
    assert [name for name, _ in rig.planner.asked] == ["clearance_ahead"]
    assert rig.progress.planning_seconds < 0.1


def test_a_goal_that_moved_meanwhile_is_planned_for_anew():
    moved = RigidTransform(X_WO.translation() + [0.0, 0.01, 0.0])
    rig = settled(Blocked(reach=way()), object_pose=moved)
    assert [name for name, _ in rig.planner.asked] == ["check_reach", "clearance_ahead"]


def test_what_the_last_look_shows_in_the_way_is_planned_around():
    planner = Blocked(reach=way())
    looks = iter([0.0, 0.02, 0.02, 0.02])
    planner.clearance_ahead = lambda plan, **seen: next(looks)
    rig = settled(planner)
    assert [name for name, _ in rig.planner.asked] == ["check_reach"]
