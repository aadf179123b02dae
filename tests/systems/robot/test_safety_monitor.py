import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.robot_wear import RobotWear
from pepper_drake.planning.safety.command_check import STOP_SENTENCES, StopReason, stop_sentence
from pepper_drake.planning.safety.contact_detection import ContactParams
from pepper_drake.planning.safety.safe_command import SafeCommand
from pepper_drake.systems.robot.safety_monitor import SafetyMonitor

START = np.array([1.0, -0.5, 0.5, 0.8, 0.1])


TIME_STEP = 0.02


class Rig:
    """A safety monitor before an arm that goes where it is sent, but for what holds it."""

    def __init__(self, contact=None):
        self.limits = shared_control_model().command_limits(arm_joints("right"))
        self.monitor = SafetyMonitor(
            limits=self.limits,
            start_position=START,
            minimum_clearance=0.005,
            contact=contact,
            time_step=TIME_STEP,
        )
        self.simulator = Simulator(self.monitor)
        self.context = self.simulator.get_mutable_context()
        self.monitor.measured_input.FixValue(self.context, START)
        self.command(START)
        self.simulator.Initialize()
        self.passed_commands = [START, START]
        self.wish, self.speed, self.ticks = START, np.zeros(5), 0

    def command(self, command):
        self.monitor.command_input.FixValue(self.context, command)

    def advance(self, duration=TIME_STEP, blocked=None, off=0.0):
        """Goes on; joints follow the last command, `blocked` up to a position or `off` [rad]."""
        for _ in range(round(duration / TIME_STEP)):
            passed = self.passed()
            self.passed_commands.append(passed)
            measured = passed + off
            if blocked is not None:
                joint, end = blocked
                measured[joint] = min(measured[joint], end)
            self.monitor.measured_input.FixValue(self.context, measured)
            # To the middle between two ticks, so that rounding does not decide what is in between.
            self.simulator.AdvanceTo((self.ticks + 0.5) * TIME_STEP)
            self.ticks += 1

    def passed(self):
        return self.monitor.GetOutputPort("safe_joint_position_command").Eval(self.context)

    def accelerations(self):
        return np.abs(np.diff(self.passed_commands, n=2, axis=0)) / TIME_STEP**2

    def drive(self, velocity, duration, blocked=None):
        """Commands a steady velocity, reached at the rate that the limits allow."""
        change = self.limits.acceleration * TIME_STEP
        for _ in range(round(duration / TIME_STEP)):
            self.speed = self.speed + np.clip(velocity - self.speed, -change, change)
            self.wish = self.wish + TIME_STEP * self.speed
            self.command(self.wish)
            self.advance(blocked=blocked)

    def reason(self):
        return StopReason(int(self.monitor.GetOutputPort("stop_reason").Eval(self.context)[0]))

    def joint(self):
        return int(self.monitor.GetOutputPort("stop_joint").Eval(self.context)[0])


def test_safe_commands_pass_in_the_same_tick():
    rig = Rig()
    for k in range(5):
        command = START + 0.002 * k**2
        rig.command(command)
        np.testing.assert_array_equal(rig.passed(), command)
        rig.advance()
    assert rig.reason() == StopReason.NONE


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (np.full(5, np.nan), StopReason.COMMAND_NOT_FINITE),
        (START + np.array([0, 1.0, 0, 0, 0]), StopReason.COMMAND_OUTSIDE_LIMITS),
        (START + np.array([0.3, 0, 0, 0, 0]), StopReason.COMMAND_TOO_FAST),
    ],
)
def test_an_unsafe_command_never_passes_and_the_robot_brakes(command, reason):
    rig = Rig()
    rig.drive(np.full(5, 0.5), 0.2)
    rig.command(command)
    rig.advance(0.1)
    assert rig.reason() == reason
    held = rig.passed_commands[-1]
    assert np.abs(held - START).max() < 0.2
    rig.command(START)
    rig.advance(0.2)
    assert rig.reason() == reason, "a stop is latched"
    np.testing.assert_array_equal(rig.passed(), held)
    assert rig.accelerations().max() <= 10.0 + 1e-9


@pytest.mark.parametrize("speed", [0.3, 1.0, 3.0])
def test_a_stop_brakes_at_the_acceleration_limit(speed):
    rig = Rig()
    rig.drive(np.array([-speed, 0, 0, 0, 0]), 0.06)
    before = (rig.passed_commands[-1] - rig.passed_commands[-2]) / TIME_STEP
    begin = rig.passed_commands[-1]
    rig.monitor.stop_request_input.FixValue(rig.context, [1.0])
    rig.advance(0.5)
    assert rig.accelerations().max() <= 10.0 + 1e-9
    travelled = rig.passed() - begin
    assert np.abs(travelled).max() <= np.abs(before).max() ** 2 / 20 + 1e-9


def test_a_close_link_stops_the_robot():
    rig = Rig()
    rig.advance()
    rig.monitor.clearance_input.FixValue(rig.context, [0.006])
    assert rig.reason() == StopReason.NONE
    rig.monitor.clearance_input.FixValue(rig.context, [0.004])
    assert rig.reason() == StopReason.LINK_TOO_CLOSE
    rig.command(START + 0.001)
    np.testing.assert_array_equal(rig.passed(), START)


def test_a_stop_can_be_asked_for():
    rig = Rig()
    rig.advance()
    rig.monitor.stop_request_input.FixValue(rig.context, [1.0])
    rig.advance()
    assert rig.reason() == StopReason.REQUESTED


def test_without_a_first_tick_nothing_moves():
    rig = Rig()
    context = rig.monitor.CreateDefaultContext()
    rig.monitor.measured_input.FixValue(context, START)
    rig.monitor.command_input.FixValue(context, np.full(5, np.inf))
    port = rig.monitor.GetOutputPort("safe_joint_position_command")
    np.testing.assert_array_equal(port.Eval(context), START)


@pytest.mark.parametrize("speed", [0.45, 0.6, 1.5])
def test_a_joint_that_is_held_is_noticed_within_a_tenth_of_a_second_and_goes_back(speed):
    rig = Rig(contact=ContactParams())
    velocity = np.array([speed, 0, 0, 0, 0])
    rig.drive(velocity, 0.5)
    assert rig.reason() == StopReason.NONE
    end = rig.passed_commands[-1][0]
    rig.drive(velocity, 0.1, blocked=(0, end))
    assert rig.reason() == StopReason.JOINT_HELD
    assert rig.joint() == 0
    rig.advance(1.0, blocked=(0, end))
    assert rig.passed()[0] < end - 0.01, "it backs off"
    assert rig.accelerations().max() <= 10.0 + 1e-9


def test_a_joint_that_is_not_measured_is_not_called_held():
    rig = Rig(contact=ContactParams())
    velocity = np.array([1.0, 0, 0, 0, 0])
    rig.drive(velocity, 0.3)
    end = rig.passed_commands[-1][0]
    rig.monitor.measurement_age_input.FixValue(rig.context, [0.02, 0.0])
    rig.drive(velocity, 0.1, blocked=(0, end))
    assert rig.reason() == StopReason.NONE
    rig.monitor.measurement_age_input.FixValue(rig.context, [0.2, 0.0])
    rig.monitor.missing_joint_input.FixValue(rig.context, [0.0])
    assert rig.reason() == StopReason.JOINTS_NOT_MEASURED
    assert rig.joint() == 0


def test_joints_that_follow_are_never_held():
    rig = Rig(contact=ContactParams())
    rig.drive(np.array([-3.0, 0.3, 2.0, 1.0, -2.0]), 0.3)
    assert rig.reason() == StopReason.NONE


def test_a_stopped_robot_does_not_go_on_pressing():
    rig = Rig(contact=ContactParams())
    rig.drive(np.array([0.5, 0, 0, 0, 0]), 0.3)
    rig.monitor.clearance_input.FixValue(rig.context, [0.0])
    end = rig.passed_commands[-1][0] - 0.03
    rig.advance(1.0, blocked=(0, end))
    assert rig.reason() == StopReason.LINK_TOO_CLOSE
    assert rig.passed()[0] == pytest.approx(end, abs=1e-9)
    assert rig.accelerations().max() <= 10.0 + 1e-9


def test_a_stopped_robot_yields_again_when_it_is_pressed_anew():
    rig = Rig(contact=ContactParams())
    rig.monitor.clearance_input.FixValue(rig.context, [0.0])
    for end in (START[0] - 0.03, START[0] - 0.1):
        rig.advance(2.0, blocked=(0, end))
        assert rig.passed()[0] == pytest.approx(end, abs=1e-9)


def wandering(deviation, seconds, seed=0):
    """Largest motion of a stopped joint's command whose deviation is a function of time [rad]."""
    rig, rng = Rig(contact=ContactParams()), np.random.default_rng(seed)
    rig.monitor.clearance_input.FixValue(rig.context, [0.0])
    rig.advance(0.5)
    moved = 0.0
    for k in range(round(seconds / TIME_STEP)):
        rig.advance(off=np.array([0.0, deviation(TIME_STEP * k, rng), 0.0, 0.0, 0.0]))
        moved = max(moved, abs(rig.passed()[1] - START[1]))
    return moved


@pytest.mark.parametrize(
    "off",
    [
        lambda t, rng: -min(0.03 + 0.05 * t, 0.3),
        lambda t, rng: -0.1 + 0.03 * np.sin(2.0 * t),
        lambda t, rng: -0.1 + rng.normal(0.0, 0.005),
        lambda t, rng: 0.1 + 0.02 * np.sign(np.sin(5.0 * t)),
    ],
)
def test_a_joint_that_is_off_by_a_changing_angle_does_not_lead_it_away_either(off):
    assert wandering(off, 20.0) <= 0.2


@pytest.mark.parametrize("seed", range(20))
def test_noise_of_a_joint_that_is_off_is_not_taken_for_pressing(seed):
    moved = wandering(lambda t, rng: 0.1 + rng.normal(0.0, 0.005), 1.5, seed)
    assert 0.0 < moved <= ContactParams().give_way_angle + 1e-9


@pytest.mark.parametrize("side", [-0.5, 0.5])
@pytest.mark.parametrize("off", [-0.1, -0.05, 0.05, 0.1])
def test_slack_and_latency_of_a_worn_robot_are_not_taken_for_pressing(off, side):
    wear = RobotWear.draw(0)
    slack, delay = float(wear.backlash.max()), round(wear.command_latency / TIME_STEP)
    params, limits = ContactParams().on_worn_robot(wear), Rig().limits
    command = SafeCommand.at_rest(START).stopped(StopReason.REQUESTED)
    joint, sent = START[1] + side * slack, [START[1]] * (delay + 1)
    for _ in range(150):
        command = command.advanced(START, limits, TIME_STEP)
        sent.append(command.position[1])
        reached = sent[-1 - delay]
        joint = np.clip(joint, reached - 0.5 * slack, reached + 0.5 * slack)
        measured = command.position + [0.0, joint + off - command.position[1], 0.0, 0.0, 0.0]
        command = command.compared(measured, params, TIME_STEP)
        moved = abs(command.position[1] - START[1])
        assert moved <= params.give_way_angle + 1e-9
    assert moved == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("off", [-0.1, 0.03, 0.1])
@pytest.mark.parametrize("stopped_before", [True, False])
def test_a_joint_that_is_off_by_an_angle_does_not_lead_its_command_away(off, stopped_before):
    """A motor or encoder that is off: the command followed the measured position for ever."""
    rig = Rig(contact=ContactParams())
    away = np.array([0.0, off, 0.0, 0.0, 0.0])
    rig.advance(0.5)
    if stopped_before:
        rig.monitor.clearance_input.FixValue(rig.context, [0.0])
        rig.advance(0.1)
    before = rig.passed().copy()
    rig.advance(5.0, off=away)
    assert rig.reason() == (StopReason.LINK_TOO_CLOSE if stopped_before else StopReason.JOINT_HELD)
    moved = rig.passed() - before
    assert moved[1] == pytest.approx(0.0, abs=1e-9), "what the test moved it is taken back"
    np.testing.assert_array_equal(moved[[0, 2, 3, 4]], 0.0)
    # Once it is right again, and pressed, it yields as any other.
    rig.advance(1.0)
    rig.advance(2.0, blocked=(1, START[1] - 0.05))
    assert rig.passed()[1] == pytest.approx(START[1] - 0.05, abs=1e-9)


@pytest.mark.parametrize(
    ("ages", "reason"),
    [
        ([0.0, 0.0], StopReason.NONE),
        ([0.08, 0.0], StopReason.NONE),
        ([0.2, 0.0], StopReason.JOINTS_NOT_MEASURED),
        ([0.0, np.nan], StopReason.BASE_NOT_MEASURED),
    ],
)
def test_measurements_that_do_not_come_stop_the_robot(ages, reason):
    rig = Rig()
    rig.monitor.measurement_age_input.FixValue(rig.context, ages)
    rig.advance()
    assert rig.reason() == reason


@pytest.mark.parametrize(
    ("port", "value", "reason"),
    [
        ("clearance", [np.nan], StopReason.LINK_TOO_CLOSE),
        ("body_clearance", [0.001], StopReason.BODY_TOO_CLOSE),
        ("base_held", [1.0], StopReason.BASE_HELD),
    ],
)
def test_each_watcher_has_its_name(port, value, reason):
    rig = Rig()
    rig.monitor.GetInputPort(port).FixValue(rig.context, value)
    assert rig.reason() == reason


def test_every_reason_has_its_sentence_and_names_the_joint():
    assert set(STOP_SENTENCES) == set(StopReason)
    assert "RElbowRoll" in stop_sentence(StopReason.JOINT_HELD, "RElbowRoll")
    assert "RElbowRoll" in stop_sentence(StopReason.JOINTS_NOT_MEASURED, "RElbowRoll")


def test_a_stop_is_lifted_when_the_reset_changes_and_goes_on_from_where_the_joints_are():
    rig = Rig()
    rig.monitor.reset_input.FixValue(rig.context, [0.0])
    rig.advance()
    rig.monitor.stop_request_input.FixValue(rig.context, [1.0])
    rig.advance()
    rig.monitor.stop_request_input.FixValue(rig.context, [0.0])
    rig.advance()
    assert rig.reason() == StopReason.REQUESTED
    measured = START + 0.05
    rig.monitor.measured_input.FixValue(rig.context, measured)
    rig.command(measured)
    rig.monitor.reset_input.FixValue(rig.context, [1.0])
    rig.simulator.AdvanceTo(rig.context.get_time() + 1.5 * TIME_STEP)
    assert rig.reason() == StopReason.NONE
    np.testing.assert_allclose(rig.passed(), measured, atol=1e-9)


def test_commands_that_follow_a_limp_joint_are_not_judged():
    rig = Rig()
    rig.advance()
    rig.monitor.limp_input.FixValue(rig.context, [1.0])
    rig.command(START + 0.5)
    rig.advance()
    assert rig.reason() == StopReason.NONE
    rig.monitor.limp_input.FixValue(rig.context, [0.0])
    rig.command(START)
    rig.advance()
    assert rig.reason() != StopReason.NONE


def test_joints_that_still_move_are_caught_after_a_reset_and_held_ones_noticed_later():
    rig = Rig(contact=ContactParams())
    rig.monitor.reset_input.FixValue(rig.context, [0.0])
    rig.advance()
    rig.monitor.reset_input.FixValue(rig.context, [1.0])
    rig.advance()
    rig.monitor.measured_input.FixValue(rig.context, START + 0.05)
    rig.simulator.AdvanceTo(rig.context.get_time() + 0.4)
    assert rig.reason() == StopReason.NONE
    rig.simulator.AdvanceTo(rig.context.get_time() + 0.3)
    assert rig.reason() == StopReason.JOINT_HELD
