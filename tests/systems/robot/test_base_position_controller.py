import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import ConstantVectorSource, LogVectorOutput, MatrixGain

from pepper_drake.diagrams.station import PepperStation
from pepper_drake.diagrams.station_config import StationConfig
from pepper_drake.models.control_model import BODY_JOINTS, shared_control_model
from pepper_drake.models.scene import load_scene
from pepper_drake.systems.robot.base_position_controller import (
    BaseMotion,
    BasePositionController,
    approach_speed,
    step_base_reference,
    wrap_angle,
)
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


def servo_at(velocity):
    servo = BaseVelocityController()
    simulator = Simulator(servo)
    context = simulator.get_mutable_context()
    servo.base_pose_input.FixValue(context, [0.0, 0, 0])
    servo.velocity_input.FixValue(context, velocity)
    return servo, simulator, context


@pytest.mark.parametrize("command", [0.0, np.nan])
def test_a_command_of_zero_brakes_the_base_and_so_does_one_that_is_not_finite(command):
    servo, simulator, context = servo_at([0.2, 0, 0])
    simulator.AdvanceTo(1.005)
    x = servo.get_output_port().Eval(context)[0]
    servo.velocity_input.FixValue(context, [command, 0, 0])
    simulator.AdvanceTo(2)
    state = servo.get_output_port().Eval(context)
    assert state[0] - x == pytest.approx(0.2**2 / 2, abs=0.002)
    np.testing.assert_array_equal(state[3:], 0)


@settings(max_examples=20, deadline=None)
@given(
    commands=st.lists(
        st.lists(st.floats(allow_nan=True), min_size=3, max_size=3), min_size=1, max_size=5
    )
)
def test_no_command_makes_the_base_faster_than_its_limits(commands):
    servo, simulator, context = servo_at([0.0, 0, 0])
    before, tick = np.zeros(3), 0
    for command in commands:
        servo.velocity_input.FixValue(context, command)
        for _ in range(30):
            simulator.AdvanceTo((tick + 0.5) * 0.01)
            tick += 1
            rates = servo.get_output_port().Eval(context)[3:]
            assert np.isfinite(rates).all()
            assert np.hypot(*rates[:2]) <= 0.55 * np.sqrt(2) + 1e-9
            assert abs(rates[2]) <= 2.0 + 1e-9
            assert abs(rates[2] - before[2]) <= 3.0 * 0.01 + 1e-9
            before = rates


def test_a_turning_base_drives_an_arc():
    servo, simulator, context = servo_at([0.3, 0, 1.0])
    simulator.AdvanceTo(1.0)
    begin = servo.get_output_port().Eval(context)[:3]
    simulator.AdvanceTo(2.0)
    x, y, yaw = servo.get_output_port().Eval(context)[:3]
    # The chord of an arc of radius 0.3 m, one radian long.
    assert yaw - begin[2] == pytest.approx(1.0)
    assert np.hypot(x - begin[0], y - begin[1]) == pytest.approx(0.6 * np.sin(0.5), abs=1e-4)


@given(distance=st.floats(0, 3), step=st.floats(1e-4, 0.02))
def test_the_approach_never_brakes_harder_than_it_may(distance, step):
    """From any distance on, the speed sinks along the way by no more than the deceleration."""
    speed = approach_speed(distance, 10.0, 0.3, 4.0)
    nearer = max(distance - step, 0.0)
    after = approach_speed(nearer, 10.0, 0.3, 4.0)
    assert after <= speed
    # v dv = a dx
    assert 0.5 * (speed**2 - after**2) <= 0.3 * (distance - nearer) + 1e-9


@settings(max_examples=25, deadline=None)
@given(x=st.floats(-1, 1), y=st.floats(-1, 1), yaw=st.floats(-3, 3))
def test_the_reference_gets_to_its_goal_without_passing_it(x, y, yaw):
    pose, velocity, goal = np.zeros(3), np.zeros(3), np.array([x, y, yaw])
    distance = np.hypot(x, y)
    for _ in range(500):
        before = velocity
        pose, velocity = step_base_reference(pose, velocity, goal, BaseMotion(), 0.02)
        assert np.hypot(*(velocity - before)[:2]) <= 0.3 * 0.02 + 1e-9
        along = pose[:2] @ goal[:2] / max(distance, 1e-9)
        assert along <= distance + 5e-4
        assert abs(pose[2]) <= abs(yaw) + 1e-3
    np.testing.assert_allclose(pose, goal, atol=1e-3)


def station_drive(goal, stop_at=None):
    """The true base of the station on its way to a goal: times and places."""
    scene, model = load_scene("free"), shared_control_model()
    builder = DiagramBuilder()
    station = builder.AddSystem(PepperStation(scene, StationConfig(cameras=False), model))
    driver = builder.AddSystem(BasePositionController())
    target = builder.AddSystem(ConstantVectorSource(goal))
    joints = [scene.robot.positions()[name] for name in BODY_JOINTS]
    posture = builder.AddSystem(ConstantVectorSource(joints))
    builder.Connect(target.get_output_port(), driver.base_goal_input)
    builder.Connect(station.GetOutputPort("base_pose"), driver.base_pose_input)
    builder.Connect(
        driver.GetOutputPort("base_velocity_command"),
        station.GetInputPort("base_velocity_command"),
    )
    builder.Connect(posture.get_output_port(), station.GetInputPort("joint_position_command"))
    if stop_at is not None:
        stop = builder.AddSystem(StepSource(stop_at))
        builder.Connect(stop.get_output_port(), driver.stop_input)
    log = LogVectorOutput(station.GetOutputPort("base_pose"), builder, 0.01)
    held = LogVectorOutput(driver.GetOutputPort("held"), builder, 0.02)
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(5.0)
    found = log.FindLog(simulator.get_context())
    assert not held.FindLog(simulator.get_context()).data().any()
    return found.sample_times(), found.data().T


class StepSource(LeafSystem):
    """Zero, and one from a time on."""

    def __init__(self, start):
        super().__init__()
        self._start = start
        self.DeclareVectorOutputPort("stop", 1, self._calc)

    def _calc(self, context, output):
        output.SetAtIndex(0, float(context.get_time() >= self._start))


def start_of_the_base():
    positions = load_scene("free").robot.positions()
    return np.array([positions[name] for name in ("BaseX", "BaseY", "BaseYaw")])


def test_the_simulated_base_does_not_pass_its_place():
    start = start_of_the_base()
    goal = start + [0.5, 0.1, 0.3]
    _, poses = station_drive(goal)
    way = (goal - start)[:2]
    along = (poses[:, :2] - start[:2]) @ way / np.hypot(*way)
    assert along.max() <= np.hypot(*way) + 0.001
    np.testing.assert_allclose(poses[-1], goal, atol=0.001)


def test_a_stop_on_the_way_brakes_within_the_acceleration_and_stays():
    start = start_of_the_base()
    times, poses = station_drive(start + [1.0, 0.0, 0.0], stop_at=1.5)
    velocity = np.gradient(poses[:, 0], times)
    at_stop = velocity[np.searchsorted(times, 1.5)]
    assert at_stop > 0.25
    travelled = poses[-1, 0] - np.interp(1.5, times, poses[:, 0])
    # Braking, and the two control periods by which the base lags.
    assert travelled <= at_stop**2 / (2 * 0.3) + 0.06 * at_stop + 0.003
    assert abs(velocity[-1]) < 1e-4


def test_a_base_that_something_holds_is_noticed():
    driver = BasePositionController()
    simulator = Simulator(driver)
    context = simulator.get_mutable_context()
    driver.base_pose_input.FixValue(context, [0.0, 0, 0])
    driver.base_goal_input.FixValue(context, [1.0, 0, 0])
    simulator.AdvanceTo(0.3)
    assert driver.GetOutputPort("held").Eval(context)[0] == 0
    simulator.AdvanceTo(1.0)
    assert driver.GetOutputPort("held").Eval(context)[0] == 1


@pytest.mark.parametrize(
    ("angle", "wrapped"), [(np.pi, np.pi), (-np.pi, np.pi), (7, 7 - 2 * np.pi)]
)
def test_angles_wrap(angle, wrapped):
    assert wrap_angle(angle) == pytest.approx(wrapped)
