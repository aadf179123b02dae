"""Signals that jump about end a reach; what is moved once, or moves as things do, does not."""

from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.mapping.depth_validity import DepthFault
from pepper_drake.perception.mapping.dynamic_obstacles import DepthFrame
from pepper_drake.perception.mapping.seen_space import SeenSpace
from pepper_drake.perception.mapping.voxel_map import VoxelMap
from pepper_drake.planning.reach.likely_cause import with_cause
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_plan import PlanStatus
from pepper_drake.planning.reach.reach_state_machine import step
from pepper_drake.planning.reach.steadiness import Steadiness, SteadinessParams
from pepper_drake.planning.safety.command_check import StopReason
from tests.planning.reach.scripted_planner import (
    TIMING,
    ScriptedPlanner,
    Supervised,
    plan,
    unseen_plan,
)

PARAMS = SteadinessParams()
PERIOD = 0.05
GRID = np.stack(np.meshgrid(*[np.arange(6) * 0.02] * 3), axis=-1).reshape(-1, 3)


def observed(
    seconds,
    *,
    goal=lambda k: 0.0,
    base=lambda k: 0.0,
    cloud=lambda k: 0.0,
    still=GRID[:0],
    tracked=GRID[:0],
):
    """Steadiness after a time in which signals are shifted along x as functions of the step [m]."""
    first = Supervised().seen
    steadiness = Steadiness()
    for k in range(round(seconds / PERIOD)):
        ahead = np.array([1.0, 0.0, 0.0])
        observation = replace(
            first,
            time=k * PERIOD,
            X_WO=RigidTransform(first.p_WO + goal(k) * ahead),
            base_pose=first.base_pose + base(k) * ahead,
            cloud=np.concatenate((still, GRID + cloud(k))),
            cloud_time=0.2 * (k // 4),
            predicted_cloud=tracked,
        )
        steadiness = steadiness.advanced(observation, PARAMS)
    return steadiness


@pytest.mark.parametrize(
    ("signal", "size", "reason"),
    [("goal", 0.02, "goal"), ("base", 0.005, "base"), ("cloud", 0.02, "cloud")],
)
def test_noise_on_a_signal_is_named_within_two_seconds(signal, size, reason):
    rng = np.random.default_rng(3)
    noise = {
        "goal": rng.normal(0.0, 1.7 * size, 100),
        "base": rng.normal(0.0, size, 100),
        "cloud": rng.normal(0.0, size, (100, 216, 3)),
    }
    steadiness = observed(2.0, **{signal: lambda k: noise[signal][k]})
    unsteady = steadiness.unsteady_signal(PARAMS)
    assert unsteady is not None
    assert unsteady[0] == f"{reason}_unsteady"


def test_mean_jump_is_the_one_that_was_made():
    steadiness = observed(8.0, goal=lambda k: 0.01 * (k % 2))
    assert steadiness.goal == pytest.approx(0.01, rel=1e-2)


def test_a_goal_that_is_moved_once_is_steady():
    assert observed(2.0, goal=lambda k: 0.5 * (k > 20)).unsteady_signal(PARAMS) is None


def test_a_goal_that_is_carried_is_steady():
    assert observed(4.0, goal=lambda k: 0.3 * PERIOD * k).unsteady_signal(PARAMS) is None


def test_an_obstacle_that_moves_may_be_most_of_the_cloud_or_all():
    carried = {"cloud": lambda k: 0.05 * (k // 4)}
    assert observed(4.0, **carried).unsteady_signal(PARAMS) is None
    third = GRID[: len(GRID) // 2] - [0.5, 0.0, 0.0]
    assert observed(4.0, **carried, still=third).unsteady_signal(PARAMS) is None


def test_only_what_is_near_a_tracked_obstacle_may_jump():
    noise = np.random.default_rng(3).normal(0.0, 0.02, (100, 216, 3))
    for place, steady in ((GRID, True), (GRID + [1.0, 0.0, 0.0], False)):
        found = observed(2.0, cloud=lambda k: noise[k], tracked=place)
        assert (found.unsteady_signal(PARAMS) is None) == steady


def test_a_cloud_that_jumps_about_as_a_whole_is_not_steady():
    # As from a camera whose pose is measured with noise.
    shifts = np.random.default_rng(4).normal(0.0, 0.02, (100, 3))
    unsteady = observed(2.0, cloud=lambda k: shifts[k]).unsteady_signal(PARAMS)
    assert unsteady is not None
    assert unsteady[0] == "cloud_unsteady"


def test_a_reach_ends_when_the_goal_jumps_about():
    one = Supervised()
    one.until(ReachMode.REACHING)
    state, rng = one.state, np.random.default_rng(5)
    for k in range(40):
        X_WO = RigidTransform(one.seen.p_WO + rng.normal(0.0, 0.03, 3))
        now = one.time + k * PERIOD
        seen = replace(one.seen, time=now, cloud_time=now, X_WO=X_WO)
        state = step(state, seen, ScriptedPlanner(), TIMING)
    assert (state.mode, state.reason) == (ReachMode.FAILED, "goal_unsteady")


def test_a_stop_is_explained_by_the_signal_that_jumps_about():
    one = Supervised()
    one.until(ReachMode.REACHING)
    unsteady = replace(one.state, steadiness=Steadiness(cloud=0.02))
    close = replace(one.seen, time=one.time, stop_reason=StopReason.LINK_TOO_CLOSE)
    state = step(unsteady, close, ScriptedPlanner(), TIMING)
    assert state.reason == "cloud_unsteady"
    assert "the arm went too close" in state.message
    asked = replace(one.seen, time=one.time, stop_reason=StopReason.REQUESTED)
    assert step(unsteady, asked, ScriptedPlanner(), TIMING).reason == "requested"


def mapped(count, stuck_from=None, shift=0.0):
    """Steadiness after clouds of a map whose points move a little with each image."""
    first, steadiness = Supervised().seen, Steadiness()
    camera = CAMERA_DEPTH.intrinsics
    depth = np.ones((camera.height, camera.width), np.float32)
    rng = np.random.default_rng(0)
    sent = np.zeros((0, 3), np.float32)
    for k in range(count):
        positions = (np.eye(3) + rng.normal(0.0, 1e-4, (3, 3))).astype(np.float32)
        if stuck_from is None or k < stuck_from:
            sent = positions
        voxels = replace(VoxelMap.empty(), positions=positions)
        view = DepthFrame(depth, RigidTransform(), 0.2 * k, camera)
        observation = replace(
            first,
            time=0.2 * k + 0.05,
            cloud_time=0.2 * k,
            cloud=sent.astype(float) + shift,
            space=SeenSpace(voxels, (view,)),
        )
        steadiness = steadiness.advanced(observation, PARAMS)
    return steadiness


def test_a_cloud_that_is_stuck_on_a_still_scene_is_told_by_the_map():
    assert mapped(20).unsteady_signal(PARAMS) is None
    assert mapped(4 + PARAMS.other_clouds - 1, stuck_from=4).unsteady_signal(PARAMS) is None
    unsteady = mapped(4 + PARAMS.other_clouds, stuck_from=4).unsteady_signal(PARAMS)
    assert unsteady is not None
    assert unsteady[0] == "cloud_wrong"


def test_a_cloud_that_comes_shifted_is_told_by_the_map():
    unsteady = mapped(10, shift=0.05).unsteady_signal(PARAMS)
    assert unsteady is not None
    assert unsteady[0] == "cloud_wrong"


def failed_with(one, **changing):
    """A reach stepped until it has failed, with signals that are functions of the step."""
    for k in range(400):
        if one.state.mode == ReachMode.FAILED:
            return one.state
        one.set(**{name: value(k) for name, value in changing.items()}).step()
    raise AssertionError(one.state.mode)


def noisy_goal(size):
    rng, p_WO = np.random.default_rng(6), Supervised().seen.p_WO
    return lambda k: RigidTransform(p_WO + rng.normal(0.0, size, 3))


@pytest.mark.parametrize("size", [0.0, 0.001, 0.02])
@pytest.mark.parametrize("status", [PlanStatus.NO_CLEAR_PATH, PlanStatus.NOT_SEEN])
def test_before_the_arm_starts_a_goal_that_jumps_about_is_why_no_plan_is_clear(size, status):
    reach = unseen_plan() if status == PlanStatus.NOT_SEEN else plan(status, "no path")
    state = failed_with(Supervised(ScriptedPlanner(reach=reach)), X_WO=noisy_goal(size))
    assert state.reason == ("goal_unsteady" if size > 0.01 else status.value)
    assert state.message.endswith(reach.message), "the symptom is named, too"


def test_before_the_arm_starts_a_cloud_that_is_not_the_maps_is_why_no_plan_is_clear():
    one = Supervised(ScriptedPlanner(placement=plan(PlanStatus.NO_CLEAR_PATH, "-6 mm")))
    camera, rng = CAMERA_DEPTH.intrinsics, np.random.default_rng(7)
    depth = np.ones((camera.height, camera.width), np.float32)

    def space(_):
        view = DepthFrame(depth, RigidTransform(), one.time, camera)
        return SeenSpace(VoxelMap.empty(), (view,))

    state = failed_with(one, space=space, cloud=lambda _: GRID + rng.normal(0.0, 0.05, GRID.shape))
    assert state.steadiness.cloud > PARAMS.cloud, "it jumps about as well"
    assert state.reason == "cloud_wrong"
    assert state.message.endswith("-6 mm")


def test_a_clear_plan_is_not_held_up_and_the_arm_starts_with_a_clean_slate():
    one = Supervised()
    noise = noisy_goal(0.002)
    while one.state.mode != ReachMode.REACHING:
        one.set(X_WO=noise(0), base_pose=np.array([0.01 * one.ticks, 0.0, 0.0])).step()
    assert one.state.steadiness.last is None
    assert one.state.steadiness.goal == 0.0


def test_a_base_that_drives_is_not_unsteady():
    one = Supervised(ScriptedPlanner(reach=plan(PlanStatus.NO_CLEAR_PATH, "no path")))
    state = failed_with(one, base_pose=lambda k: np.array([0.02 * k, 0.0, 0.0]))
    assert state.reason == "no_clear_path"


@pytest.mark.parametrize("joint", ["HeadYaw", "HeadPitch"])
def test_a_head_that_does_not_turn_is_why_the_goal_is_not_seen_or_the_drive(joint):
    head = Supervised().seen.joint_position[:2]
    off = 0.5 * np.array([joint == "HeadYaw", joint == "HeadPitch"])
    away = unseen_plan()
    for planner, seen in ((ScriptedPlanner(), False), (ScriptedPlanner(placement=away), True)):
        planner.drive = away
        for error, reason in ((off, "joint_held"), (0.0 * off, None)):
            one = Supervised(planner).set(goal_valid=seen, head_command=head + error)
            state = failed_with(one)
            assert state.reason == (reason or ("not_seen" if seen else "goal_not_seen"))
            assert (joint in state.message) == (reason is not None)


def test_a_head_on_its_way_to_the_next_view_does_not_count_as_held():
    head = Supervised().seen.joint_position[:2]
    one = Supervised().set(goal_valid=False)
    # Late by a tenth of a radian, and far off for a moment.
    state = failed_with(one, head_command=lambda k: head + (0.5 if k % 14 == 0 else 0.1))
    assert state.reason == "goal_not_seen"


def test_a_robot_that_cannot_tell_where_its_head_should_be_is_not_accused():
    assert failed_with(Supervised().set(goal_valid=False)).reason == "goal_not_seen"


def aged(cloud, image, seconds=20.0, timing=TIMING, **seen):
    """A reach that sees neither goal nor drive, with images of these ages [s]."""
    away = unseen_plan()
    one = Supervised(ScriptedPlanner(placement=away, drive=away), timing)
    for k in range(round(seconds / timing.time_step)):
        if one.state.mode == ReachMode.FAILED:
            break
        ages = [max(image, 1.9), image] if k > 4 else [np.inf, np.inf]  # The first images come.
        one.set(image_ages=np.array(ages), **seen)
        one.image_time = one.time - cloud
        one.step()
    return one


@pytest.mark.parametrize(
    ("cloud", "image", "seen", "reason"),
    [
        (0.3, 0.3, True, "not_seen"),
        (0.3, 1.2, True, "not_seen"),
        (0.45, 0.3, False, "goal_not_seen"),
        (0.3, 1.2, False, "images_missing"),
        (1.9, 0.3, False, "goal_not_seen"),
    ],
)
def test_images_that_come_late_are_why_something_is_not_seen(cloud, image, seen, reason):
    state = aged(cloud, image, goal_valid=seen).state
    assert (state.mode, state.reason) == (ReachMode.FAILED, reason)
    if reason == "images_missing":
        # The mean of the first second.
        assert "the newest is 0.9 s old on average; no marker" in state.message


def test_depth_images_that_come_late_are_why_a_drive_is_not_seen():
    one = aged(0.3, 0.3, seconds=1.5)
    assert one.state.mode != ReachMode.FAILED
    late = replace(one.state, steadiness=replace(one.state.steadiness, ages=np.array([1.0, 0.3])))
    lost = late.fail(one.time, PlanStatus.NOT_SEEN.value, "a place")
    named = with_cause(lost, PARAMS)
    assert named.reason == "cloud_missing"
    assert named.message.endswith("the newest is 1.0 s old on average; a place")
    # Nothing else follows from it.
    other = late.fail(one.time, PlanStatus.NO_CLEAR_PATH.value, "no path")
    assert with_cause(other, PARAMS) is other


def test_a_depth_camera_whose_images_are_rejected_is_named_for_that():
    one = aged(1.2, 0.3, seconds=1.5, cloud_fault=DepthFault.NOISE)
    late = replace(one.state, steadiness=replace(one.state.steadiness, ages=np.array([1.0, 0.3])))
    named = with_cause(late.fail(one.time, PlanStatus.NOT_SEEN.value, "a place"), PARAMS)
    assert named.reason == "cloud_missing"
    assert "noise" in named.message


@pytest.mark.parametrize(("image", "longer"), [(0.3, 5.0), (5.0, 0.0)])
def test_the_search_may_last_as_much_longer_as_it_waits_for_images(image, longer):
    """But not if they are lost."""
    timing = replace(TIMING, goal_timeout=4.0)
    one = aged(0.3, image, timing=timing, goal_valid=False, search_delay=5.0)
    assert one.state.mode == ReachMode.FAILED
    assert one.time == pytest.approx(timing.goal_timeout + longer, abs=0.3)
