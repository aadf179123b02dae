import numpy as np
import pytest

from pepper_drake import scenario
from pepper_drake.benchmarking.case import Case
from pepper_drake.benchmarking.diagram_reach import (
    arrival_row,
    commanded_hand,
    first_motion,
    interpolate_held,
    outcome_of,
)
from pepper_drake.benchmarking.methods import get_method
from pepper_drake.benchmarking.metrics import rms_jerk
from pepper_drake.models.control_model import arm_joints, body_indices, shared_control_model
from pepper_drake.models.pepper import BODY_JOINTS
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.reach.reach_mode import ReachMode


@pytest.mark.parametrize(
    ("report", "clearance", "started", "outcome"),
    [
        ("reached", 0.02, True, "reached"),
        ("reached", 0.0, True, "touched"),
        ("failed", -0.01, True, "touched"),
        ("failed", -0.01, False, "touched"),
        ("failed", 0.02, True, "failed"),
        ("failed", 0.02, False, "refused"),
    ],
)
def test_touching_counts_before_all_else(report, clearance, started, outcome):
    assert outcome_of(report, clearance, started) == outcome


@pytest.mark.parametrize(
    ("letter", "collision_checked"), [("b", False), ("c", True), ("d", True), ("e", False)]
)
def test_couplings_of_others_start_as_their_authors_have_them(
    letter, collision_checked, monkeypatch
):
    monkeypatch.setattr(scenario, "Reaching", lambda *parts: parts)
    _, _, coupling, config = get_method(letter).run._build(Case(0, "free"))
    assert coupling is not None
    assert config.planner.collision_checked == collision_checked


class Log:
    """Ten rows; the arm may start at row 4 and is commanded to move from row 6 on."""

    time_s = np.arange(10) / 100
    joint_command_rad = np.zeros((10, len(BODY_JOINTS)))


def test_the_hand_has_arrived_when_it_holds_for_the_last_time():
    mode = np.repeat([ReachMode.REACHING, ReachMode.HOLDING] * 2 + [ReachMode.DONE], 3)
    assert arrival_row(mode) == 9


def test_the_first_motion_waits_for_the_plan_and_for_the_first_command():
    log = Log()
    log.joint_command_rad = np.zeros((10, len(BODY_JOINTS)))
    log.joint_command_rad[:, 0] = np.arange(10)  # The head moves all the time.
    log.joint_command_rad[6:, body_indices(arm_joints("right"))[1]] = 0.01
    moving = np.arange(10) >= 4
    assert first_motion(log, moving, "right", 0.15) == pytest.approx(0.15 + 0.02)
    assert np.isnan(first_motion(log, moving, "left", 0.15))


def test_the_commanded_hand_is_where_the_arms_joints_put_it():
    commands = np.zeros((2, len(BODY_JOINTS)))
    commands[1, body_indices(arm_joints("left"))] = [0.3, 0.4, -0.5, -0.6, 0.7]
    hand = commanded_hand(commands, "left")
    kinematics = arm_kinematics(shared_control_model(), "left")
    for row, joints in zip(hand, ([0.0] * 5, [0.3, 0.4, -0.5, -0.6, 0.7]), strict=True):
        np.testing.assert_allclose(row, kinematics.hand_pose(np.array(joints)).translation())


def test_a_path_is_measured_without_the_steps_in_which_it_was_commanded():
    times = np.arange(0.0, 2.0, 0.02)
    path = np.stack([np.sin(times), np.cos(times), 0.1 * times**3], axis=1)
    held = np.repeat(path, 2, axis=0)
    fine = np.arange(0.0, 2.0 - 0.02 + 1e-9, 0.01)
    smooth = interpolate_held(np.concatenate((held[:1].repeat(7, axis=0), held)), 2)
    expected = np.stack([np.sin(fine), np.cos(fine), 0.1 * fine**3], axis=1)
    np.testing.assert_allclose(smooth, expected, atol=1e-6)
    # Of sin and cos the third derivative has length 1, of 0.1 t³ it is 0.6.
    assert rms_jerk(smooth, 0.01) == pytest.approx(np.hypot(1.0, 0.6), rel=0.02)
    assert rms_jerk(held, 0.01) > 100.0


@pytest.mark.parametrize("count", [1, 6])
def test_a_hand_that_rests_has_no_steps(count):
    resting = np.ones((count, 3))
    np.testing.assert_array_equal(interpolate_held(resting, 2)[0], np.ones(3))
