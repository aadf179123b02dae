import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.planning.ik.command_check import StopReason
from pepper_drake.systems.robot.safety_monitor import SafetyMonitor

START = np.array([1.0, -0.5, 0.5, 0.8, 0.1])


class Rig:
    def __init__(self):
        limits = shared_control_model().command_limits(arm_joints("right"))
        self.monitor = SafetyMonitor(limits=limits, minimum_clearance=0.005)
        self.simulator = Simulator(self.monitor)
        self.context = self.simulator.get_mutable_context()
        self.monitor.measured_input.FixValue(self.context, START)
        self.command(START)

    def command(self, command):
        self.monitor.command_input.FixValue(self.context, command)

    def advance(self, duration):
        self.simulator.AdvanceTo(self.context.get_time() + duration)

    def passed(self):
        return self.monitor.GetOutputPort("safe_joint_position_command").Eval(self.context)

    def reason(self):
        return StopReason(int(self.monitor.GetOutputPort("stop_reason").Eval(self.context)[0]))


def test_safe_commands_pass_in_the_same_tick():
    rig = Rig()
    for k in range(5):
        command = START + 0.01 * k
        rig.command(command)
        np.testing.assert_array_equal(rig.passed(), command)
        rig.advance(0.01)
    assert rig.reason() == StopReason.NONE


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (np.full(5, np.nan), StopReason.COMMAND_NOT_FINITE),
        (START + np.array([0, 1.0, 0, 0, 0]), StopReason.COMMAND_OUTSIDE_LIMITS),
        (START + np.array([0.2, 0, 0, 0, 0]), StopReason.COMMAND_TOO_FAST),
    ],
)
def test_an_unsafe_command_never_passes_and_the_last_safe_one_is_held(command, reason):
    rig = Rig()
    rig.advance(0.01)
    safe = START + 0.01
    rig.command(safe)
    rig.advance(0.01)
    rig.command(command)
    np.testing.assert_array_equal(rig.passed(), safe)
    rig.advance(0.05)
    assert rig.reason() == reason
    rig.command(safe)
    rig.advance(0.05)
    assert rig.reason() == reason, "a stop is latched"
    np.testing.assert_array_equal(rig.passed(), safe)


def test_a_close_link_stops_the_robot():
    rig = Rig()
    rig.advance(0.01)
    rig.monitor.clearance_input.FixValue(rig.context, [0.006])
    assert rig.reason() == StopReason.NONE
    rig.monitor.clearance_input.FixValue(rig.context, [0.004])
    assert rig.reason() == StopReason.LINK_TOO_CLOSE
    rig.command(START + 0.01)
    np.testing.assert_array_equal(rig.passed(), START)


def test_a_stop_can_be_asked_for():
    rig = Rig()
    rig.advance(0.01)
    rig.monitor.stop_request_input.FixValue(rig.context, [1.0])
    rig.advance(0.02)
    assert rig.reason() == StopReason.REQUESTED


def test_without_a_first_tick_nothing_moves():
    rig = Rig()
    context = rig.monitor.CreateDefaultContext()
    rig.monitor.measured_input.FixValue(context, START)
    rig.monitor.command_input.FixValue(context, np.full(5, np.inf))
    port = rig.monitor.GetOutputPort("safe_joint_position_command")
    np.testing.assert_array_equal(port.Eval(context), START)
