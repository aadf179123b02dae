"""A goal that the arm does not reach from where the robot stands: it drives elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.reach_mode import ReachCommand, ReachMode
from pepper_drake.planning.reach.reach_plan import PlanStatus
from pepper_drake.planning.reach.reach_state import apply_command
from pepper_drake.planning.safety.command_check import StopReason
from tests.planning.reach.scripted_planner import (
    ADAPTED,
    NO_DETOUR,
    P_TG,
    STAND,
    TIMING,
    X_WO,
    ScriptedPlanner,
    Supervised,
    on_its_way,
    path_plan,
    plan,
    unseen_plan,
)

RETURN = replace(path_plan(), movement=replace(ADAPTED, origin=Origin.RETURN))
"""A way back to the first posture."""
ELSEWHERE = replace(plan(), base_pose=STAND + [0.0, 0.3, 0.0])
"""Another base placement."""
FAR = RigidTransform(X_WO.translation() + [0.0, 0.3, 0.0])
"""Pose of a goal that has moved out of the arm's reach."""
AT_REST = ArmState(np.zeros(5), np.zeros(5))


def waiting(**prepared) -> Supervised:
    """An arm that has retreated from something that stays in its way."""
    answers = {"home": RETURN, "placement": ELSEWHERE, "reach": NO_DETOUR} | prepared
    one = on_its_way(ahead=0.0, detour=NO_DETOUR, **answers)
    one.image_time = None
    one.advance(1.0)
    assert one.state.suspended_plan is not None
    return one.set(arm=AT_REST, measured_arm=np.zeros(5))


def moved_away(**prepared) -> Supervised:
    """An arm on an adapted movement whose goal has moved out of reach."""
    answers = {"home": RETURN, "placement": ELSEWHERE, "reach": NO_DETOUR} | prepared
    one = on_its_way(detour=NO_DETOUR, **answers)
    movement = replace(ADAPTED, origin=Origin.ADAPTED)
    before = replace(path_plan(), p_WO=X_WO.translation(), movement=movement)
    one.state = replace(one.state, plan=before)
    one.image_time = None
    one.set(X_WO=FAR, goal_position=P_TG + [0.0, 0.3, 0.0]).advance(1.0)
    assert one.state.suspended_plan is not None
    return one.set(arm=AT_REST, measured_arm=np.zeros(5))


def until_it_returns(one: Supervised, limit: float = 60.0) -> Supervised:
    while one.state.performed_origin != Origin.RETURN and one.time < limit:
        one.step()
    assert one.state.performed_origin == Origin.RETURN, one.state.message
    return one


def clear_from_elsewhere(one: Supervised) -> Supervised:
    one.planner.reach, one.planner.ahead = path_plan(), 0.02
    return one


def test_where_something_stays_in_the_way_the_robot_drives_elsewhere_and_reaches():
    one = until_it_returns(waiting())
    assert one.state.waited == pytest.approx(TIMING.blocked_timeout, abs=0.5)
    one.until(ReachMode.LOOKING, limit=60.0)
    clear_from_elsewhere(one).until(ReachMode.DRIVING, limit=60.0)
    np.testing.assert_array_equal(one.state.base_goal, ELSEWHERE.base_pose)
    one.until(ReachMode.REACHING, limit=60.0)
    assert one.state.given_up is None
    assert (one.state.places, one.state.waited) == (2, 0.0)
    one.set(hand_position=P_TG).until(ReachMode.DONE, limit=70.0)
    assert one.state.reason == one.state.message == ""


def test_each_movement_has_a_number_of_its_own():
    one = until_it_returns(waiting())
    before = one.state.active_movement
    one.until(ReachMode.LOOKING, limit=60.0)
    assert one.state.active_movement == 0  # The arm holds still while the robot drives.
    clear_from_elsewhere(one).until(ReachMode.REACHING, limit=60.0)
    assert one.state.active_movement == before + 1


def test_a_goal_that_moved_away_is_followed_as_soon_as_no_path_to_it_is_found():
    one = moved_away()
    since = one.state.since
    until_it_returns(one)
    waited = one.state.since - since
    assert TIMING.detour_delay <= waited <= TIMING.detour_delay + TIMING.latency.plan + 0.2
    one.until(ReachMode.LOOKING)
    clear_from_elsewhere(one).until(ReachMode.REACHING)
    assert one.state.planned_with.X_WO is FAR


def test_a_taught_movement_that_does_not_reach_the_goal_it_follows_is_begun_elsewhere():
    one = on_its_way(home=RETURN, placement=ELSEWHERE, detour=NO_DETOUR, reach=NO_DETOUR)
    one.image_time = None
    one.set(X_WO=FAR, goal_position=P_TG + [0.0, 0.3, 0.0], arm=AT_REST, measured_arm=np.zeros(5))
    until_it_returns(one).until(ReachMode.LOOKING)
    clear_from_elsewhere(one).until(ReachMode.DRIVING, limit=20.0)
    assert one.state.places == 2


def test_the_arm_returns_to_the_posture_in_which_it_started():
    one = waiting()
    first, asked = one.state.started_with.arm.position, []
    planner = one.planner
    answer = planner.plan_return
    planner.plan_return = lambda reach, posture, seen: (
        asked.append((reach, posture)) or answer(reach, posture, seen)
    )
    until_it_returns(one)
    assert asked == [(one.state.suspended_plan, first)]


def test_where_no_place_is_better_the_reach_fails_for_its_first_reason():
    placement = plan(PlanStatus.NO_STANDING_ROOM, "there is no room")
    one = waiting(placement=placement).failed("no_clear_path", limit=60.0)
    assert one.state.message.startswith("something came in the way and has not gone")
    assert one.state.message.endswith("; from elsewhere, there is no room")
    one = moved_away(placement=placement).failed("goal_moved", limit=60.0)
    assert one.state.message.endswith("from here; from elsewhere, there is no room")


def test_a_place_from_which_the_goal_is_not_reached_either():
    one = waiting()
    one.failed("no_clear_path", limit=90.0)
    assert one.state.places == TIMING.max_base_placements
    assert one.state.message.endswith("; from elsewhere, no path")


@pytest.mark.parametrize("start", [waiting, moved_away])
def test_a_robot_without_a_way_back_stays(start):
    one = start(home=NO_DETOUR)
    one.failed("goal_moved" if start is moved_away else "no_clear_path", limit=60.0)
    assert ReachMode.DRIVING not in one.modes[one.modes.index(ReachMode.REACHING) :]
    assert "elsewhere" not in one.state.message
    assert one.state.waited == pytest.approx(TIMING.blocked_timeout, abs=0.1)


def test_a_robot_whose_path_was_not_checked_stays():
    one = Supervised().set(hand_position=P_TG).until(ReachMode.HOLDING)
    one.set(X_WO=FAR, goal_position=P_TG + [0.0, 0.3, 0.0]).failed("goal_moved", limit=30.0)
    assert "plan_return" not in one.planner.questions()


def test_a_robot_that_may_not_drive_stays():
    one = waiting()
    one.state = replace(one.state, may_drive=False)
    one.failed("no_clear_path", limit=60.0)
    assert "plan_return" not in one.planner.questions()


def test_space_on_the_way_back_that_was_not_seen_is_looked_at_first():
    unseen = unseen_plan()
    one = waiting(home=unseen)
    one.advance(TIMING.blocked_timeout)
    assert one.state.mode == ReachMode.REACHING
    assert one.state.look_at == tuple(unseen.look_at)
    one.planner.home = RETURN
    until_it_returns(one)


def test_space_on_the_way_back_that_stays_unseen_ends_the_reach():
    one = waiting(home=unseen_plan()).failed("no_clear_path", limit=60.0)
    longest = TIMING.blocked_timeout + TIMING.unseen_timeout
    assert one.state.waited == pytest.approx(longest, abs=0.1)


def test_a_path_that_becomes_clear_while_the_arm_returns_is_taken():
    one = until_it_returns(waiting())
    one.planner.detour, one.planner.ahead = path_plan(), 0.02
    one.advance(TIMING.latency.plan + 0.1)
    assert one.state.plan is one.planner.detour
    assert one.state.given_up is None
    one.set(hand_position=P_TG).until(ReachMode.DONE, limit=70.0)


def test_an_arm_that_has_to_retreat_on_its_way_back_gives_up():
    one = until_it_returns(waiting())
    one.planner.ahead = 0.02
    retreat = replace(path_plan(), movement=replace(ADAPTED, origin=Origin.RETREAT))
    one.state = one.state.with_plan(retreat, one.time, one.state.suspended_plan)
    one.failed("no_clear_path", limit=60.0)
    assert one.modes[-2] == ReachMode.REACHING


def test_the_robot_does_not_drive_before_its_arm_is_at_rest():
    one = until_it_returns(waiting())
    moving = ArmState(np.zeros(5), np.full(5, 2.0 * TIMING.at_rest))
    one.set(arm=moving).advance(one.seen.tau + 2.0)
    assert one.state.mode == ReachMode.REACHING
    one.set(arm=AT_REST).until(ReachMode.LOOKING, limit=60.0)


def test_the_time_of_a_reach_does_not_run_out_on_the_way_back():
    one = until_it_returns(waiting())
    one.state = replace(one.state, started=one.time - TIMING.reach_timeout - 1.0)
    one.until(ReachMode.LOOKING, limit=60.0)


def test_a_stop_on_the_way_back_keeps_its_reason():
    one = until_it_returns(waiting())
    one.set(stop_reason=StopReason.JOINT_HELD).failed("joint_held", limit=60.0)


def test_a_new_command_forgets_what_was_given_up():
    one = until_it_returns(waiting())
    idle = apply_command(one.state, ReachCommand.IDLE, one.time)
    assert apply_command(idle, ReachCommand.REACH, one.time).given_up is None


def at_the_goal(**changes) -> Supervised:
    one = Supervised().set(hand_position=P_TG).until(ReachMode.HOLDING)
    return one.set(**changes)


def test_a_goal_that_shows_elsewhere_while_the_hand_holds_is_not_reached():
    one = at_the_goal(goal_age=TIMING.goal_confirmed + 0.3).advance(2.0)
    one.set(goal_age=0.0, X_WO=FAR, goal_position=P_TG + [0.0, 0.3, 0.0]).advance(1.0)
    assert one.state.mode == ReachMode.HOLDING
    one.set(hand_position=P_TG + [0.0, 0.3, 0.0]).until(ReachMode.DONE)


def test_a_goal_that_the_hand_does_not_follow_while_it_holds_is_gone_to():
    one = Supervised(ScriptedPlanner(reach=path_plan())).set(hand_position=P_TG)
    one.until(ReachMode.HOLDING)
    one.set(X_WO=FAR, goal_position=P_TG + [0.0, 0.3, 0.0])
    one.planner.home, one.planner.placement = RETURN, ELSEWHERE
    one.planner.detour = one.planner.reach = NO_DETOUR
    until_it_returns(one)
    assert one.state.given_up[0] == "goal_moved"
    assert "300 mm" in one.state.given_up[1]


def test_the_time_at_the_goal_does_not_count_as_time_of_the_reach():
    timing = replace(TIMING, holding=np.inf)
    one = Supervised(ScriptedPlanner(reach=path_plan()), timing)
    one.set(hand_position=P_TG).until(ReachMode.HOLDING).advance(TIMING.reach_timeout + 5.0)
    one.planner.ahead = 0.0
    one.set(hand_position=np.zeros(3)).until(ReachMode.REACHING, limit=60.0).advance(2.0)
    assert one.state.mode == ReachMode.REACHING


def test_a_hand_that_is_off_by_less_than_is_followed_holds_on():
    followed = on_its_way().planner.params.tolerance.followed
    one = at_the_goal(hand_position=P_TG + [0.0, 0.9 * followed, 0.0])
    one.until(ReachMode.DONE)
    assert one.modes.count(ReachMode.REACHING) == 1


def test_a_hand_that_waits_for_a_lost_goal_ends_unconfirmed():
    one = at_the_goal(goal_age=TIMING.goal_lost - 0.01).advance(TIMING.holding + 0.5)
    assert one.state.mode == ReachMode.HOLDING
    one.set(goal_age=TIMING.goal_lost + 0.01).until(ReachMode.DONE)
    assert one.state.reason == "reached_unconfirmed"
