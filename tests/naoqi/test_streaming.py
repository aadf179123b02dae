import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.naoqi.streaming import (
    LARGEST_FRACTION,
    LEAST_FRACTION,
    lookahead,
    streamed_command,
)
from pepper_drake.robot_server.robot.joint_controller import INDEX, JointController
from pepper_drake.robot_server.robot.robot_model import MAX_VELOCITY
from pepper_drake.robot_server.robot.robot_port import KinematicRobot

_ARM = ("RShoulderPitch", "RShoulderRoll", "RElbowYaw", "RElbowRoll", "RWristYaw")


def test_lookahead_grows_with_the_round_trip_until_the_link_is_too_slow():
    assert lookahead(0.0) == pytest.approx(0.04)
    assert lookahead(0.2) == pytest.approx(0.24)
    assert lookahead(0.22) is None


@given(st.floats(0.001, 0.25), st.lists(st.floats(-2, 2), min_size=2, max_size=2))
def test_a_joint_arrives_when_it_should_unless_it_may_not_be_so_fast(seconds, way):
    fastest = np.array([7.0, 9.0])
    command = streamed_command(("a", "b"), [0.0, 0.0], way, seconds, fastest)
    assert command.targets == tuple(way)
    for distance, fraction, speed in zip(way, command.fractions, fastest, strict=True):
        assert LEAST_FRACTION <= fraction <= LARGEST_FRACTION
        if LEAST_FRACTION < fraction < LARGEST_FRACTION:
            assert fraction * speed * seconds == pytest.approx(abs(distance))
    assert command.fraction == max(command.fractions)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_pose_that_is_no_number_is_never_sent(bad):
    with pytest.raises(ValueError, match="finite"):
        streamed_command(("a",), [0.0], [bad], 0.06, [7.0])


def test_a_streamed_movement_is_followed_without_stutter_and_stops_when_commands_stop():
    robot = KinematicRobot()
    joints = JointController(robot.state())
    joints.stiffness[:] = 1.0
    k = [INDEX[name] for name in _ARM]
    start = joints.command[k].copy()
    start[1], start[3] = -0.4, 0.6
    joints.command[k] = start
    ahead = 0.06
    moving = np.zeros(5)

    def plan(t):
        return start + np.array([0.5, 0.2, 0.4, 0.3, 0.6]) * (1 - np.cos(2 * t)) / 2

    errors, before = [], joints.velocity[k].copy()
    for cycle in range(150):
        t = 0.02 * cycle
        command = streamed_command(_ARM, joints.command[k], plan(t + ahead), ahead, MAX_VELOCITY[k])
        for name, target, fraction in zip(
            command.names, command.targets, command.fractions, strict=True
        ):
            joints.set_targets({name: target}, fraction)
        joints.step(robot.state())
        acceleration = (joints.velocity[k] - before) / 0.02
        speed = np.abs(plan(t + ahead) - plan(t)) / ahead
        # Slower than the least fraction, a joint goes on in steps: it is sent too fast.
        smooth = speed > 1.5 * LEAST_FRACTION * MAX_VELOCITY[k]
        if cycle >= 20:
            moving += smooth
            # The plan itself accelerates by at most 0.6 * 4 / 2 = 1.2 rad/s^2.
            assert np.abs(acceleration[smooth]).max(initial=0.0) < 3.0
        before = joints.velocity[k].copy()
        errors.append(joints.command[k] - plan(t + 0.02))
    assert np.abs(errors[20:]).max() < 0.05
    assert (moving[[0, 2, 3]] > 30).all()
    goal = plan(0.02 * 149 + ahead)
    for _ in range(10):
        joints.step(robot.state())
    np.testing.assert_allclose(joints.command[k], goal, atol=0.02)
    assert np.abs(joints.velocity[k]).max() < 0.2
