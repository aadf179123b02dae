import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.pepper import elbow_roll_limits
from pepper_drake.planning.ik.command_check import StopReason, check_command
from pepper_drake.planning.ik.command_limits import limit_joint_command

TIME_STEP = 0.01


@pytest.fixture(scope="module")
def right_limits():
    return shared_control_model().command_limits(arm_joints("right"), speed_fraction=0.5)


def test_a_reachable_velocity_is_integrated_as_it_is(right_limits):
    position = np.array([1.0, -0.5, 0.5, 0.8, 0.1])
    wish = np.array([0.05, -0.04, 0.03, 0.02, -0.01])
    following, velocity = limit_joint_command(
        position, np.zeros(5), wish, arm="right", limits=right_limits, time_step=TIME_STEP
    )
    np.testing.assert_allclose(following, position + TIME_STEP * wish, atol=1e-15)
    np.testing.assert_allclose(velocity, wish, atol=1e-12)


def test_acceleration_is_limited(right_limits):
    _, velocity = limit_joint_command(
        np.array([1.0, -0.5, 0.5, 0.8, 0.1]),
        np.zeros(5),
        np.full(5, 5.0),
        arm="right",
        limits=right_limits,
        time_step=TIME_STEP,
    )
    np.testing.assert_allclose(velocity, right_limits.acceleration * TIME_STEP, rtol=1e-9)


@settings(max_examples=30)
@given(
    wishes=st.lists(st.lists(st.floats(-20, 20), min_size=5, max_size=5), min_size=1, max_size=6),
    arm=st.sampled_from(["left", "right"]),
)
def test_no_wish_ever_leaves_a_limit(wishes, arm):
    limits = shared_control_model().command_limits(arm_joints(arm))
    side = 1 if arm == "left" else -1
    position = np.array([1.5, 0.12 * side, -1.2 * side, -0.5 * side, 0.0])
    velocity = np.zeros(5)
    for wish in wishes:
        for _ in range(60):
            before = position
            position, velocity = limit_joint_command(
                position, velocity, np.array(wish), arm=arm, limits=limits, time_step=TIME_STEP
            )
            assert check_command(position, before, limits, time_step=TIME_STEP) == StopReason.NONE
            lower, upper = elbow_roll_limits(position[2], arm)
            assert lower - 1e-12 <= position[3] <= upper + 1e-12


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (np.array([np.nan, 0, 0, 0, 0]), StopReason.COMMAND_NOT_FINITE),
        (np.array([9.0, 0, 0, 0, 0]), StopReason.COMMAND_OUTSIDE_LIMITS),
        (np.array([0.1, 0, 0, 0, 0]), StopReason.COMMAND_TOO_FAST),
        (np.array([0.01, 0, 0, 0, 0]), StopReason.NONE),
    ],
)
def test_each_unsafe_command_has_its_name(right_limits, change, reason):
    previous = np.array([1.0, -0.5, 0.5, 0.8, 0.1])
    status = check_command(previous + change, previous, right_limits, time_step=TIME_STEP)
    assert status == reason
