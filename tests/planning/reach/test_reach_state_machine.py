from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.perception.mapping.depth_validity import DepthFault
from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_plan import PlanStatus
from pepper_drake.planning.safety.command_check import StopReason
from tests.planning.reach.scripted_planner import (
    ADAPTED,
    CLOUD,
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

STEP = TIMING.time_step


def test_the_whole_reach_when_all_goes_well():
    one = Supervised()
    np.testing.assert_array_equal(one.state.base_goal, np.full(3, np.nan))
    one.until(ReachMode.DRIVING)
    np.testing.assert_array_equal(one.state.base_goal, STAND)
    one.until(ReachMode.REACHING)
    assert one.state.active_movement == 1
    assert one.state.movement is ADAPTED
    one.advance(0.5).set(hand_position=P_TG + [0.002, 0, 0]).until(ReachMode.DONE)
    assert one.state.active_movement == 1
    assert one.modes == list(ReachMode)[: ReachMode.DONE + 1]
    assert one.state.reason == one.state.message == ""


def test_each_mode_lasts_as_long_as_timing_and_latency_say():
    one = Supervised().until(ReachMode.DRIVING)
    # The goal is seen at 0, looked at for 0.5 s; the place to stand is known 0.4 s later.
    assert one.state.since == pytest.approx(TIMING.looking + TIMING.latency.base_placement)
    driving = one.state.since
    one.until(ReachMode.SETTLING)
    assert one.state.since - driving <= 2 * STEP + 1e-9
    settling = one.state.since
    one.until(ReachMode.REACHING)
    # Planned at half the time, known before it is over, confirmed then.
    assert one.state.since - settling == pytest.approx(TIMING.settling + TIMING.latency.check)
    one.set(hand_position=P_TG)
    reaching = one.state.since
    one.until(ReachMode.HOLDING)
    assert one.state.since - reaching == pytest.approx(1.0 + TIMING.dwell, abs=STEP + 1e-3)
    holding = one.state.since
    one.until(ReachMode.DONE)
    assert one.state.since - holding == pytest.approx(TIMING.holding)


def test_the_planner_is_asked_with_what_was_observed():
    one = Supervised().until(ReachMode.REACHING)
    # While the base placement is planned, the head looks along the likely drive at each image.
    asked = one.planner.questions()
    assert list(dict.fromkeys(asked)) == ["look_along_drive", "plan_base_placement", "check_reach"]
    assert asked.count("plan_base_placement") == asked.count("check_reach") == 1
    assert asked[-1] == "check_reach"
    for _, observation in one.planner.asked:
        np.testing.assert_array_equal(observation.cloud, CLOUD)
        assert observation.X_WO is X_WO


def test_a_goal_that_is_never_seen():
    one = Supervised().set(goal_valid=False, goal_age=np.inf).failed("goal_not_seen")
    assert one.state.since == pytest.approx(TIMING.goal_timeout, abs=STEP + 1e-3)
    assert not one.was_active
    assert one.planner.asked == []


@pytest.mark.parametrize("image_time", [np.nan, -np.inf, np.inf])
def test_a_cloud_that_never_comes(image_time):
    one = Supervised()
    one.image_time = image_time
    one.failed("cloud_missing")
    assert not one.was_active
    assert one.planner.asked == []


def test_a_cloud_that_comes_late_is_waited_for():
    one = Supervised()
    one.image_time = -np.inf
    one.advance(0.8)
    assert one.state.mode == ReachMode.LOOKING
    one.image_time = None
    one.until(ReachMode.DRIVING)


def test_a_cloud_that_is_old_before_the_start_is_no_reason_to_go():
    one = Supervised()
    one.image_time = 0.0
    one.advance(TIMING.looking + STEP)  # Fresh enough just then, and then no more.
    assert one.planner.questions() == ["look_along_drive", "plan_base_placement"]
    late = Supervised()
    late.image_time = -0.1
    late.advance(1.0)
    assert late.planner.asked == []


@pytest.mark.parametrize(
    "status",
    [PlanStatus.OUT_OF_REACH, PlanStatus.NO_CLEAR_PATH, PlanStatus.NO_STANDING_ROOM],
)
@pytest.mark.parametrize("when", ["placement", "reach"])
def test_a_reach_that_the_planner_refuses_never_starts(status, when):
    one = Supervised(ScriptedPlanner(**{when: plan(status, "the planner's own words")}))
    one.failed(status.value, limit=20.0)
    assert one.state.message == "the planner's own words"
    assert not one.was_active
    assert (ReachMode.DRIVING in one.modes) == (when == "reach")
    if when == "reach":
        assert one.state.places == TIMING.max_base_placements


def test_what_was_not_seen_is_looked_at_before_the_arm_starts():
    one = Supervised(ScriptedPlanner(reach=unseen_plan())).until(ReachMode.SETTLING)
    one.advance(1.0)
    np.testing.assert_allclose(one.state.look_at, [1.0, -0.3, 0.8])
    assert not one.was_active
    one.planner.reach = plan()
    one.until(ReachMode.REACHING)
    assert np.isnan(one.state.look_at).all()


def test_what_stays_unseen_is_not_passed():
    one = Supervised(ScriptedPlanner(reach=unseen_plan())).until(ReachMode.SETTLING)
    settling = one.state.since
    one.failed("not_seen", limit=30.0)
    assert one.state.places == TIMING.max_base_placements  # From elsewhere it might be seen.
    assert one.state.since - settling > TIMING.max_base_placements * TIMING.unseen_timeout
    assert not one.was_active


def test_a_base_that_does_not_arrive():
    assert not Supervised().set(base_arrived=False).failed("drive_failed").was_active


@pytest.mark.parametrize(
    ("off", "jitter", "blocked", "reason"),
    [
        (0.04, 0.002, False, "base_unsteady"),
        (0.06, 0.002, False, "drive_failed"),
        (0.04, 0.0, False, "drive_failed"),
        (0.04, 0.002, True, "drive_failed"),
    ],
)
def test_a_base_that_does_not_come_to_rest_at_its_place_is_unsteady(off, jitter, blocked, reason):
    one = Supervised().set(base_arrived=False, base_blocked=blocked).until(ReachMode.DRIVING)
    for k in range(round(1.1 * TIMING.driving_timeout / TIMING.time_step)):
        one.set(base_pose=STAND + [0.0, off + jitter * (k % 3), 0.0]).step()
    assert (one.state.mode, one.state.reason) == (ReachMode.FAILED, reason)


def test_a_base_that_something_stands_in_the_way_of_says_so():
    one = Supervised().set(base_arrived=False, base_blocked=True).failed("drive_failed")
    assert "something stands in its way" in one.state.message


def test_a_reach_that_fails_on_the_drive_stops_the_base():
    one = Supervised().set(base_arrived=False).until(ReachMode.DRIVING)
    np.testing.assert_array_equal(one.state.base_goal, STAND)
    one.set(goal_age=TIMING.goal_lost + 1.0).failed("goal_lost")
    assert np.isnan(one.state.base_goal).all()


def test_images_that_come_too_seldom_are_the_cause_of_a_reach_that_takes_too_long():
    one = Supervised().until(ReachMode.REACHING)
    while one.state.mode == ReachMode.REACHING:
        # A new image every second: the arm waits for half of the time.
        one.image_time = np.floor(one.time)
        one.step()
    assert one.state.reason == "cloud_missing"
    assert "so late or so seldom" in one.state.message


def test_images_that_show_nothing_are_the_cause_of_a_reach_that_waited_for_others():
    """A person's arm stayed right before the camera, which was said to be late."""
    one = Supervised().until(ReachMode.REACHING)
    while one.state.mode == ReachMode.REACHING:
        one.image_time = np.floor(one.time)
        is_used = one.time - one.image_time < 0.3
        one.set(cloud_fault=DepthFault.NONE if is_used else DepthFault.BLANK).step()
    assert one.state.reason == "cloud_missing"
    assert "show nothing at all: the robot waited for others for" in one.state.message


def test_images_that_come_too_seldom_are_the_cause_of_a_drive_that_takes_too_long():
    one = Supervised(timing=replace(TIMING, driving_timeout=8.0)).set(base_arrived=False)
    one.until(ReachMode.DRIVING)
    while one.state.mode == ReachMode.DRIVING:
        one.image_time = np.floor(one.time)
        one.step()
    assert one.state.reason == "cloud_missing"
    assert "so late or so seldom" in one.state.message


@pytest.mark.parametrize(
    ("base_pose", "words"),
    [((300.0, -20.0, 1.0), "from the goal"), ((np.nan, 0.0, 0.0), "not a number")],
)
def test_a_base_is_not_sent_where_no_planner_would_place_it(base_pose, words):
    one = Supervised(ScriptedPlanner(placement=replace(plan(), base_pose=np.array(base_pose))))
    one.failed("plan_invalid")
    assert words in one.state.message
    assert ReachMode.DRIVING not in one.modes


def test_a_goal_that_was_carried_away_is_not_taken_for_an_error_of_the_planner():
    one = on_its_way(ahead=0.004).look()
    one.set(X_WO=RigidTransform([2.0, 0.0, 0.7])).advance(0.3)
    assert one.state.plan is one.planner.detour
    assert one.state.reason != "plan_invalid"


@pytest.mark.parametrize("question", ["reach", "detour"])
def test_an_arm_is_not_moved_along_what_is_no_path(question):
    nowhere = replace(path_plan(), joint_path=np.full((9, 5), np.nan))
    planner = ScriptedPlanner(**{question: nowhere})
    one = Supervised(planner)
    if question == "detour":
        planner.reach = path_plan()
        one.until(ReachMode.REACHING)
        planner.ahead = 0.0
    one.failed("plan_invalid")
    assert "joint angles" in one.state.message


@pytest.mark.parametrize("hip_pitch", [-0.9, 0.5, np.nan])
def test_the_torso_does_not_lean_as_far_as_it_would_fall(hip_pitch):
    one = Supervised(ScriptedPlanner(placement=replace(plan(), hip_pitch=hip_pitch)))
    one.failed("plan_invalid")
    assert "hip angle" in one.state.message


def test_a_stop_names_the_joint_that_it_is_about():
    one = Supervised().until(ReachMode.REACHING)
    one.set(stop_reason=StopReason.JOINT_HELD, stop_joint="RElbowYaw").failed("joint_held")
    assert one.state.message.startswith("RElbowYaw did not follow")


@pytest.mark.parametrize("mode", [m for m in ReachMode if m < ReachMode.DONE])
@pytest.mark.parametrize("reason", [r for r in StopReason if r != StopReason.NONE])
def test_a_stop_ends_every_mode_and_switches_the_arm_off(mode, reason):
    one = Supervised().set(hand_position=P_TG).until(mode)
    one.set(stop_reason=reason).failed(reason.name.lower())
    one.set(stop_reason=StopReason.NONE).advance(0.5).failed(reason.name.lower())


@pytest.mark.parametrize("mode", [ReachMode.DRIVING, ReachMode.REACHING])
def test_a_goal_that_was_not_seen_for_long_is_lost(mode):
    one = Supervised().set(base_arrived=mode != ReachMode.DRIVING).until(mode)
    one.set(goal_age=TIMING.goal_lost - 0.01).advance(0.1)
    assert one.state.mode == mode
    one.set(goal_age=TIMING.goal_lost + 0.01).failed("goal_lost")


def test_a_hand_that_stays_away_from_its_goal():
    one = Supervised().until(ReachMode.REACHING).set(hand_position=P_TG + [0.0, 0.03, 0.04])
    assert "50 mm" in one.failed("not_reached").state.message


def test_a_hand_just_outside_the_tolerance_is_accepted_when_the_time_is_over():
    one = Supervised().until(ReachMode.REACHING)
    tolerance = one.planner.params.tolerance
    between = (tolerance.arrive + tolerance.accept) / 2
    one.set(hand_position=P_TG + [between, 0, 0]).advance(TIMING.movement_timeout_ratio - 0.1)
    assert one.state.mode == ReachMode.REACHING
    one.until(ReachMode.DONE)


def test_a_hand_that_only_passes_the_goal_does_not_count_as_there():
    one = Supervised().until(ReachMode.REACHING).advance(1.1)
    one.set(hand_position=P_TG).advance(0.1)
    one.set(hand_position=P_TG + [0.05, 0, 0]).advance(0.3)
    assert one.state.mode == ReachMode.REACHING
    one.failed("not_reached")


def test_an_end_is_final():
    one = Supervised().set(hand_position=P_TG).until(ReachMode.DONE)
    state = one.state
    one.set(stop_reason=StopReason.REQUESTED, goal_age=100.0).advance(0.5)
    assert one.state is state


def test_a_plan_is_confirmed_by_the_last_look_before_the_arm_starts():
    one = settled(ScriptedPlanner(reach=path_plan()))
    assert one.planner.questions()[0] == "remaining_clearance"
    assert "check_reach" not in one.planner.questions()


def test_a_goal_that_moved_meanwhile_is_planned_for_anew():
    moved = RigidTransform(X_WO.translation() + [0.0, 0.01, 0.0])
    one = settled(ScriptedPlanner(reach=path_plan()), X_WO=moved)
    assert one.planner.questions()[:2] == ["check_reach", "remaining_clearance"]


def test_what_the_last_look_shows_in_the_way_is_planned_around():
    one = Supervised(ScriptedPlanner(reach=path_plan())).until(ReachMode.SETTLING)
    one.advance(TIMING.settling - STEP)
    one.planner.ahead = 0.0
    one.step()
    assert one.planner.questions()[-2:] == ["remaining_clearance", "check_reach"]
    one.planner.ahead = 0.02
    one.until(ReachMode.REACHING)


def test_a_scene_that_never_rests_is_given_up():
    one = Supervised(ScriptedPlanner(reach=path_plan(), ahead=0.0))
    assert not one.failed("no_clear_path", limit=30.0).was_active


def settled(planner, **changes):
    """An arm on its way through SETTLING, with changes after the first plan was made."""
    one = Supervised(planner).until(ReachMode.SETTLING).advance(0.3)
    assert planner.questions()[-1] == "check_reach"
    planner.asked.clear()
    return one.set(**changes).until(ReachMode.REACHING)


# Depth images that stop.


@pytest.mark.parametrize("mode", [ReachMode.REACHING, ReachMode.HOLDING])
def test_an_arm_without_depth_images_brakes_and_the_reach_ends(mode):
    patient = replace(TIMING, holding=5.0)
    one = Supervised(ScriptedPlanner(reach=path_plan()), patient)
    one.set(hand_position=P_TG).until(mode)
    one.image_time = last = one.time
    while one.state.active_movement and one.time < last + 5.0:
        one.step()
    assert one.state.mode == mode
    assert one.time - STEP - last <= TIMING.cloud_timeout + STEP + 1e-9
    one.failed("cloud_missing")
    assert one.time - STEP - last <= TIMING.cloud_lost + STEP + 1e-9


@pytest.mark.parametrize("mode", [ReachMode.LOOKING, ReachMode.DRIVING, ReachMode.REACHING])
def test_a_cloud_that_is_missing_is_explained_and_the_base_stays(mode):
    one = Supervised().set(base_arrived=False).until(ReachMode.DRIVING)
    if mode == ReachMode.LOOKING:
        one = Supervised()
    one.set(base_arrived=mode != ReachMode.DRIVING).until(mode)
    one.image_time = -1.0
    one.set(cloud_fault=DepthFault.FROZEN).failed("cloud_missing")
    assert "same image" in one.state.message
    assert np.isnan(one.state.base_goal).all()


def test_a_base_without_depth_images_stands_and_goes_on_with_them():
    one = Supervised().set(base_arrived=False).until(ReachMode.DRIVING)
    one.image_time = one.time
    one.advance(TIMING.cloud_timeout + 2 * STEP)
    assert np.isnan(one.state.base_goal).all()
    one.image_time = None
    one.step()
    np.testing.assert_array_equal(one.state.base_goal, STAND)
    one.set(base_arrived=True).until(ReachMode.SETTLING)
    one.image_time = one.time
    one.failed("cloud_missing")


def test_an_arm_that_stopped_without_images_goes_on_by_a_new_plan():
    one = on_its_way().advance(TIMING.cloud_timeout + 2 * STEP)
    assert one.state.active_movement == 0
    one.image_time = None
    one.set(arm=ArmState(one.seen.arm.position, np.zeros(5))).advance(TIMING.latency.plan + STEP)
    assert one.state.active_movement == 2
    assert one.state.plan is one.planner.detour


def test_an_arm_that_is_not_checked_goes_on_with_its_movement_when_images_come_back():
    unchecked = replace(path_plan(), collision_checked=False)
    one = Supervised(ScriptedPlanner(reach=unchecked)).until(ReachMode.REACHING)
    one.image_time = one.time
    one.advance(TIMING.cloud_timeout + 2 * STEP)
    one.image_time = None
    one.advance(STEP)
    assert one.state.active_movement == 2
    assert one.state.plan is unchecked


# Determinism.


def test_the_state_does_not_depend_on_how_long_planning_took():
    def history(delay):
        planner = ScriptedPlanner(reach=path_plan(), ahead=0.004)
        answer = planner.replan

        def slow(plan, observation):
            sum(range(delay))
            return answer(plan, observation)

        planner.replan = slow
        one = Supervised(planner)
        return [(one.step().mode, one.state.since, one.state.movements) for _ in range(80)]

    assert history(0) == history(300_000)


@pytest.mark.parametrize(
    ("age", "words"), [(np.inf, "the bottom camera gave no usable image"), (7.0, "for 7.0 s")]
)
def test_a_goal_that_is_not_seen_for_want_of_images_is_said_to_be_that(age, words):
    unseen = {"goal_valid": False, "goal_age": np.inf}
    one = Supervised().set(**unseen, image_ages=np.array([0.1, age])).failed("images_missing")
    assert words in one.state.message
    one = Supervised()
    one.until(ReachMode.REACHING)
    one.set(goal_age=TIMING.goal_lost + 1.0, image_ages=np.array([0.1, age])).failed(
        "images_missing"
    )
