"""Verdicts of the supervision on a reach that ends, and the causes that it names."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.models.control_model import body_indices
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.separation import StaleSpace
from pepper_drake.planning.safety.command_check import StopReason
from tests.planning.reach.scripted_planner import (
    ADAPTED,
    NO_DETOUR,
    P_TG,
    TIMING,
    X_WO,
    Supervised,
    on_its_way,
    path_plan,
)

STEP = TIMING.time_step


def test_a_goal_that_was_seen_long_ago_leaves_the_reach_unconfirmed():
    one = Supervised().set(hand_position=P_TG).until(ReachMode.HOLDING)
    one.set(goal_age=TIMING.goal_confirmed + 0.3).until(ReachMode.DONE)
    assert one.state.reason == "reached_unconfirmed"
    assert "2.3 s ago" in one.state.message
    held = one.state.since - (one.state.started or 0)
    assert held > TIMING.holding + TIMING.confirmation_timeout


def test_a_goal_that_shows_while_the_hand_waits_confirms_the_reach():
    one = Supervised().set(hand_position=P_TG).until(ReachMode.HOLDING)
    one.set(goal_age=TIMING.goal_confirmed + 0.3).advance(TIMING.holding + 1.0)
    assert one.state.mode == ReachMode.HOLDING
    one.set(goal_age=0.0).until(ReachMode.DONE)
    assert one.state.reason == ""


def test_replanning_again_and_again_does_not_outlast_the_reach():
    one = on_its_way(ahead=0.004)
    one.image_time = None
    one.failed("timeout", limit=60.0)
    assert one.state.movements > 20
    assert one.state.since - one.state.started <= TIMING.reach_timeout + 2 * STEP


def test_an_arm_that_has_to_go_slowly_gets_more_time_but_not_for_ever():
    one = on_its_way(stale=StaleSpace(X_WO.translation(), 0.0, 0.5)).set(tau=5.0)
    one.image_time = None
    one.failed("timeout", limit=100.0)
    longest = TIMING.reach_timeout + TIMING.max_slowdown_extension
    assert one.state.slowed > TIMING.max_slowdown_extension
    assert one.state.since - one.state.started == pytest.approx(longest, abs=2 * STEP)


def blocked_for_good(**changes):
    one = on_its_way(ahead=0.0, detour=NO_DETOUR)
    one.image_time = None
    one.advance(1.0)
    assert one.state.suspended_plan is not None
    one.set(**changes).until(ReachMode.FAILED, limit=60.0)
    return one.state


def test_what_stays_in_the_way_is_named_in_the_end():
    state = blocked_for_good()
    assert state.reason == "no_clear_path"
    assert "in the way" in state.message
    assert state.waited == pytest.approx(TIMING.blocked_timeout, abs=2 * STEP)
    # It was on its way for 0.55 s and retreated within 0.3 s of the cloud that showed it.
    assert state.since - state.started < TIMING.blocked_timeout + 1.0


def test_a_goal_that_jumped_is_named_in_its_stead():
    state = blocked_for_good(X_WO=RigidTransform(X_WO.translation() + [0.0, 0.09, 0.0]))
    assert state.reason == "goal_moved"
    assert "90 mm" in state.message


@pytest.mark.parametrize(("moved", "reason"), [(0.0, "link_too_close"), (0.05, "goal_moved")])
def test_an_arm_that_follows_a_goal_to_an_obstacle_is_stopped_for_the_goal_that_moved(
    moved, reason
):
    one = on_its_way()
    one.set(X_WO=RigidTransform(X_WO.translation() + [0.0, moved, 0.0])).step()
    one.set(stop_reason=StopReason.LINK_TOO_CLOSE).step()
    assert one.state.reason == reason
    assert one.state.message.endswith("the arm went too close to an obstacle")


def test_an_arm_that_waits_for_a_path_to_a_goal_that_moved_says_so():
    one = on_its_way(detour=NO_DETOUR, reach=NO_DETOUR)
    movement = replace(ADAPTED, origin=Origin.ADAPTED)
    before = replace(path_plan(), p_WO=X_WO.translation(), movement=movement)
    one.state = replace(one.state, plan=before)
    one.image_time = None
    one.set(X_WO=RigidTransform(X_WO.translation() + [0.0, 0.08, 0.0]))
    one.until(ReachMode.FAILED, limit=60.0)
    assert one.state.reason == "goal_moved"
    assert "80 mm" in one.state.message
    assert one.state.message.endswith("no clear path leads to it from here")


def test_a_torso_that_tilted_is_named_in_its_stead():
    joints = np.arange(15) / 100
    joints[body_indices(["HipPitch"])] += np.radians(6)
    state = blocked_for_good(joint_position=joints)
    assert state.reason == "robot_moved"
    assert "6 degrees" in state.message


def test_an_arm_that_its_controller_leads_astray_cannot_follow():
    one = Supervised().until(ReachMode.REACHING).set(desired_position=np.array([0.3, 0, 0]))
    assert "300 mm" in one.failed("cannot_follow").state.message


def test_an_arm_that_is_held_is_not_said_to_be_unable_to_follow():
    one = Supervised().until(ReachMode.REACHING).set(desired_position=np.array([0.3, 0, 0]))
    one.set(measured_arm=np.array([0.0, 0.0, 0.0, 0.4, 0.0]))
    message = one.failed("contact").state.message
    assert "ElbowRoll" in message
    assert "23 degrees" in message
