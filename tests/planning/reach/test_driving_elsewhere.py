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
    CLOUD,
    NO_DETOUR,
    P_TG,
    STALE,
    STAND,
    THING,
    TIMING,
    X_WO,
    ScriptedPlanner,
    Supervised,
    on_its_way,
    path_plan,
    plan,
    unseen_plan,
)

STEP = TIMING.time_step
RETURN = replace(path_plan(), movement=replace(ADAPTED, origin=Origin.RETURN))
"""A way back to the first posture."""
ELSEWHERE = replace(plan(), base_pose=STAND + [0.0, 0.3, 0.0])
"""Another base placement."""
FAR = RigidTransform(X_WO.translation() + [0.0, 0.3, 0.0])
"""Pose of a goal that has moved out of the arm's reach."""
HOME = ArmState(np.zeros(5), np.zeros(5))
"""The arm at rest in the posture in which it started."""
AWAY = ArmState(np.array([0.3, 0.0, 0.0, 0.0, 0.0]), np.zeros(5))
"""The arm at rest on its way."""


def waiting(**prepared) -> Supervised:
    """An arm that has retreated from something that stays in its way."""
    answers = {"home": RETURN, "placement": ELSEWHERE, "reach": NO_DETOUR} | prepared
    one = on_its_way(ahead=0.0, detour=NO_DETOUR, **answers)
    one.image_time = None
    one.advance(1.0)
    assert one.state.suspended_plan is not None
    return one.set(arm=AWAY, measured_arm=AWAY.position)


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
    return one.set(arm=AWAY, measured_arm=AWAY.position)


def until_it_returns(one: Supervised, limit: float = 60.0) -> Supervised:
    """Steps until the arm is on its way back, and puts it there."""
    while one.state.performed_origin != Origin.RETURN and one.time < limit:
        one.step()
    assert one.state.performed_origin == Origin.RETURN, one.state.message
    return one.set(arm=HOME, measured_arm=HOME.position)


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
    one.set(X_WO=FAR, goal_position=P_TG + [0.0, 0.3, 0.0], arm=AWAY, measured_arm=AWAY.position)
    until_it_returns(one).until(ReachMode.LOOKING)
    clear_from_elsewhere(one).until(ReachMode.DRIVING, limit=20.0)
    assert one.state.places == 2


def test_the_arm_returns_to_the_posture_in_which_it_started():
    one = waiting()
    first, asked = one.state.started_with.arm.position, []
    planner = one.planner
    answer = planner.plan_return
    planner.plan_return = lambda travelled, posture, seen: (
        asked.append((travelled, posture)) or answer(travelled, posture, seen)
    )
    until_it_returns(one)
    [(travelled, posture)] = asked
    assert posture is first
    # The path on which the arm came, and not that of the retreat on which it waits.
    came = one.state.suspended_plan.joint_path
    np.testing.assert_array_equal(travelled, came[: len(travelled)])
    assert travelled[-1, 0] == pytest.approx(one.seen.arm.position[0], abs=0.15)


def test_before_it_drives_elsewhere_the_robot_looks_at_the_scene_again():
    one = until_it_returns(waiting())
    one.planner.asked.clear()
    one.until(ReachMode.LOOKING, limit=60.0).advance(TIMING.looking - STEP)
    assert "plan_base_placement" not in one.planner.questions()
    one.advance(3 * STEP)
    assert one.planner.questions().count("plan_base_placement") == 1


def test_a_robot_that_has_driven_as_often_as_it_may_stays():
    one = waiting()
    one.state = replace(one.state, places=TIMING.max_base_placements)
    one.failed("no_clear_path", limit=60.0)
    assert "plan_return" not in one.planner.questions()


def test_where_no_place_is_better_the_reach_fails_for_its_first_reason():
    placement = plan(PlanStatus.NO_STANDING_ROOM, "there is no room")
    one = until_it_returns(waiting(placement=placement)).failed("no_clear_path", limit=60.0)
    assert one.state.message.startswith("something came in the way and has not gone")
    assert one.state.message.endswith("; from elsewhere, there is no room")
    one = until_it_returns(moved_away(placement=placement)).failed("goal_moved", limit=60.0)
    assert one.state.message.endswith("from here; from elsewhere, there is no room")


def test_a_place_from_which_the_goal_is_not_reached_either():
    one = until_it_returns(waiting())
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
    assert one.state.waited == pytest.approx(TIMING.blocked_timeout, abs=0.1)
    looked = one.state.since - one.state.given_up_at
    assert looked == pytest.approx(TIMING.unseen_timeout, abs=0.1)


def test_a_path_that_becomes_clear_while_the_arm_returns_is_taken():
    one = until_it_returns(waiting())
    one.planner.detour, one.planner.ahead = path_plan(), 0.02
    one.advance(TIMING.latency.plan + 0.1)
    assert one.state.plan is one.planner.detour
    assert one.state.given_up is None
    one.set(hand_position=P_TG).until(ReachMode.DONE, limit=70.0)


def test_an_arm_that_has_to_retreat_on_its_way_back_returns_from_there():
    one = until_it_returns(waiting())
    one.planner.ahead_on_return = 0.0
    while one.state.performed_origin == Origin.RETURN:
        one.step()
    one.planner.ahead_on_return = 0.1
    until_it_returns(one).until(ReachMode.LOOKING, limit=60.0)


@pytest.mark.parametrize(
    "changes",
    [
        {"arm": AWAY, "measured_arm": AWAY.position},
        {"measured_arm": np.array([0.0, 0.0, 0.2, 0.0, 0.0])},
        {"arm": HOME._replace(velocity=np.full(5, 2.0 * TIMING.at_rest))},
        {"predicted_clearance": -0.01},
    ],
    ids=["elsewhere", "held", "moving", "braking"],
)
def test_the_robot_does_not_drive_unless_its_arm_is_back_and_at_rest(changes):
    one = until_it_returns(waiting()).set(**changes)
    one.failed("no_clear_path", limit=60.0)
    assert one.modes[-2] == ReachMode.REACHING
    assert one.state.since - one.state.given_up_at == pytest.approx(TIMING.return_timeout, abs=0.2)


def test_a_return_that_is_never_clear_ends_in_time():
    one = waiting()
    one.planner.ahead_on_return = 0.0
    one.failed("no_clear_path", limit=60.0)
    assert one.state.since - one.state.given_up_at <= TIMING.return_timeout + 0.2


def test_a_hand_that_falls_behind_on_its_way_back_cannot_follow():
    one = until_it_returns(waiting()).set(desired_position=np.array([0.3, 0.0, 0.0]))
    assert "300 mm" in one.failed("cannot_follow", limit=60.0).state.message


def test_the_arm_does_not_go_back_past_what_moves():
    one = waiting()
    one.set(predicted_cloud=THING).advance(TIMING.blocked_timeout + 5.0)
    assert "plan_return" not in one.planner.questions()
    one.failed("no_clear_path", limit=60.0)


def test_the_way_back_keeps_clear_of_all_that_a_retreat_keeps_clear_of():
    one = waiting()
    one.set(cloud=np.concatenate((CLOUD, THING)))
    until_it_returns(one)
    of_retreat, of_return = (
        one.planner.last(name).obstacles for name in ("plan_retreat", "plan_return")
    )
    assert len(of_return) > len(CLOUD) + len(THING)
    np.testing.assert_array_equal(of_return, of_retreat)


def test_the_arm_is_slow_on_its_way_back_where_it_passes_what_was_not_seen():
    one = until_it_returns(waiting())
    one.planner.stale = STALE._replace(time=0.0)
    one.advance(0.8)
    assert one.state.speed < 0.5
    assert one.state.look_at == one.planner.stale.place


def test_a_goal_that_is_not_seen_while_the_arm_returns_is_searched_for_before_the_drive():
    one = until_it_returns(waiting()).set(goal_valid=False, goal_age=TIMING.goal_lost + 1.0)
    one.until(ReachMode.LOOKING, limit=60.0).advance(0.9 * TIMING.goal_timeout)
    assert one.planner.questions().count("plan_base_placement") == 0
    one.set(goal_valid=True, goal_age=0.1)
    clear_from_elsewhere(one).until(ReachMode.DRIVING, limit=60.0)


def test_a_goal_that_still_moves_is_not_gone_to():
    one = moved_away()
    for k in range(120):
        X_WO_now = RigidTransform(FAR.translation() + [0.0, 0.005 * k, 0.0])
        one.set(X_WO=X_WO_now).step()
    assert one.state.given_up is None
    assert "plan_return" not in one.planner.questions()
    until_it_returns(one)


def test_a_reach_that_is_resumed_on_the_way_back_has_its_time_left():
    one = until_it_returns(waiting())
    one.state = replace(one.state, started=one.time - TIMING.reach_timeout + 0.1)
    one.advance(0.5)
    one.planner.detour, one.planner.ahead = path_plan(), 0.02
    one.advance(TIMING.latency.plan + 0.3)
    assert one.state.mode == ReachMode.REACHING
    assert one.state.given_up is None


def test_the_time_of_a_reach_does_not_run_out_on_the_way_back():
    one = until_it_returns(waiting())
    one.state = replace(one.state, started=one.time - TIMING.reach_timeout - 1.0)
    one.until(ReachMode.LOOKING, limit=one.time + TIMING.return_timeout)


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
    wait = TIMING.holding + TIMING.confirmation_timeout - 0.1
    one = at_the_goal(goal_age=TIMING.goal_confirmed + 0.3).advance(wait)
    one.set(goal_age=0.0, X_WO=FAR, goal_position=P_TG + [0.0, 0.3, 0.0])
    one.advance(0.9 * one.seen.tau)  # Whenever it shows, the hand has time to follow.
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
