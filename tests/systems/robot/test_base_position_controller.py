import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, MatrixGain

from pepper_drake.systems.robot.base_position_controller import BasePositionController, wrap_angle
from pepper_drake.systems.robot.base_velocity_controller import BaseVelocityController


class Drive:
    """The driver, closed through a base that follows its servo exactly."""

    def __init__(self, start, goal):
        builder = DiagramBuilder()
        self.driver = builder.AddSystem(BasePositionController())
        self.servo = builder.AddSystem(BaseVelocityController())
        odometry = builder.AddSystem(MatrixGain(np.eye(6)[:3]))
        first = builder.AddSystem(ConstantVectorSource(start))
        target = builder.AddSystem(ConstantVectorSource(goal))
        velocity = self.driver.GetOutputPort("base_velocity_command")
        builder.Connect(velocity, self.servo.velocity_input)
        builder.Connect(first.get_output_port(), self.servo.base_pose_input)
        builder.Connect(self.servo.get_output_port(), odometry.get_input_port())
        builder.Connect(odometry.get_output_port(), self.driver.base_pose_input)
        builder.Connect(target.get_output_port(), self.driver.base_goal_input)
        builder.ExportOutput(self.servo.get_output_port(), "state")
        builder.ExportOutput(velocity, "velocity")
        builder.ExportOutput(self.driver.GetOutputPort("arrived"), "arrived")
        self.simulator = Simulator(builder.Build())
        self.context = self.simulator.get_context()

    def __call__(self, name):
        port = self.simulator.get_system().GetOutputPort(name)
        return port.Eval(self.context)


@settings(max_examples=12)
@given(x=st.floats(-1, 1), y=st.floats(-1, 1), yaw=st.floats(-3, 3), start_yaw=st.floats(-3, 3))
def test_every_goal_is_reached_and_stays_reached(x, y, yaw, start_yaw):
    drive = Drive([0.1, -0.2, start_yaw], [x, y, yaw])
    drive.simulator.AdvanceTo(15)
    assert drive("arrived")[0] == 1
    state = drive("state")
    np.testing.assert_allclose(state[:2], [x, y], atol=0.003)
    assert abs(wrap_angle(state[2] - yaw)) < 0.005
    np.testing.assert_allclose(state[3:], 0, atol=0.02)


def test_the_way_is_straight_and_within_speed_and_acceleration():
    drive = Drive([0, 0, 1.0], [1.0, 0.5, 1.0])
    last = np.zeros(3)
    for k in range(400):
        drive.simulator.AdvanceTo(0.02 * (k + 1))
        velocity = drive("velocity")
        assert np.hypot(*velocity[:2]) <= 0.35 + 1e-9
        assert np.hypot(*(velocity - last)[:2]) <= 0.3 * 0.02 + 1e-9
        assert abs(velocity[2] - last[2]) <= 0.75 * 0.02 + 1e-9
        x, y = drive("state")[:2]
        assert abs(y - 0.5 * x) < 1e-3
        last = velocity


def test_without_a_goal_the_base_stays():
    drive = Drive([0.3, 0.4, 0.5], [np.nan] * 3)
    drive.simulator.AdvanceTo(1)
    np.testing.assert_array_equal(drive("state"), [0.3, 0.4, 0.5, 0, 0, 0])
    assert drive("arrived")[0] == 0


def test_a_command_that_is_not_finite_stops_the_base():
    servo = BaseVelocityController()
    simulator = Simulator(servo)
    context = simulator.get_mutable_context()
    servo.base_pose_input.FixValue(context, [0.0, 0, 0])
    servo.velocity_input.FixValue(context, [0.2, 0, 0])
    simulator.AdvanceTo(0.105)
    servo.velocity_input.FixValue(context, [np.nan, 0, 0])
    simulator.AdvanceTo(1)
    state = servo.get_output_port().Eval(context)
    assert state[0] == pytest.approx(0.2 * 0.11)
    np.testing.assert_array_equal(state[3:], 0)


def test_a_turning_base_drives_an_arc():
    servo = BaseVelocityController()
    simulator = Simulator(servo)
    context = simulator.get_mutable_context()
    servo.base_pose_input.FixValue(context, [0.0, 0, 0])
    servo.velocity_input.FixValue(context, [0.3, 0, 1.0])
    simulator.AdvanceTo(1.0)
    x, y, yaw, *_ = servo.get_output_port().Eval(context)
    angle = yaw  # One radian a second for as long as the base turned.
    np.testing.assert_allclose(
        [x, y], 0.3 * np.array([np.sin(angle), 1 - np.cos(angle)]), atol=1e-4
    )


@pytest.mark.parametrize(
    ("angle", "wrapped"), [(np.pi, np.pi), (-np.pi, np.pi), (7, 7 - 2 * np.pi)]
)
def test_angles_wrap(angle, wrapped):
    assert wrap_angle(angle) == pytest.approx(wrapped)
