import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.planning.safety.command_check import StopReason
from pepper_drake.systems.robot.arm_command import ArmCommand, ArmMode
from tests.systems.motion_example import moving

START = np.array([1.0, -0.5, 0.5, 0.8, 0.1])


def make_rig(active):
    limits = shared_control_model().command_limits(arm_joints("right"))
    system = ArmCommand(limits=limits, start_position=START - 0.2)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.measured_position_input.FixValue(context, START)
    system.movement_input.FixValue(context, moving(None, active))
    system.desired_velocity_input.FixValue(context, np.full(5, 0.05))
    return system, simulator, context


def position(system, context):
    return system.GetOutputPort("position_command").Eval(context)


def test_inactive_holds_the_measured_start():
    system, simulator, context = make_rig(active=False)
    simulator.Initialize()
    np.testing.assert_array_equal(position(system, context), START)
    simulator.AdvanceTo(0.2)
    system.measured_position_input.FixValue(context, START + 0.1)
    simulator.AdvanceTo(0.3)
    np.testing.assert_array_equal(position(system, context), START)


def test_active_integrates_one_step_a_tick():
    system, simulator, context = make_rig(active=True)
    simulator.AdvanceTo(0.0999)  # Ten ticks: at 0, 0.01, ... 0.09.
    np.testing.assert_allclose(position(system, context), START + 10 * 0.01 * 0.05)


def test_becoming_inactive_brakes_and_then_stands():
    system, simulator, context = make_rig(active=True)
    simulator.AdvanceTo(0.1)
    system.movement_input.FixValue(context, moving(None, 0))
    simulator.AdvanceTo(0.2)
    held = position(system, context)
    simulator.AdvanceTo(0.5)
    np.testing.assert_array_equal(position(system, context), held)
    velocity = system.GetOutputPort("velocity_command").Eval(context)
    np.testing.assert_array_equal(velocity, np.zeros(5))


def test_a_context_that_was_never_initialised_starts_from_the_start_position():
    system, _, _ = make_rig(active=True)
    fresh = system.CreateDefaultContext()
    np.testing.assert_array_equal(position(system, fresh), START - 0.2)


def test_a_measured_start_outside_the_limits_is_held_inside_them():
    system, simulator, context = make_rig(active=False)
    system.measured_position_input.FixValue(context, [1.0, -0.5, 0.5, 0.8, 2.0])
    simulator.AdvanceTo(0.1)
    limits = shared_control_model().command_limits(arm_joints("right"))
    assert position(system, context)[4] == limits.position_upper[4] < 2.0


def flags(system, context):
    return [system.GetOutputPort(name).Eval(context)[0] for name in ("active", "limp")]


@pytest.mark.parametrize(
    ("mode", "target", "expected"),
    [
        (ArmMode.LIMP, START + 0.2, [0, 1]),
        (ArmMode.HELD, START, [0, 0]),
        (ArmMode.JOINTS, START + 0.1, [1, 0]),
    ],
)
def test_each_mode_takes_the_arm_to_where_it_should_be(mode, target, expected):
    system, simulator, context = make_rig(active=False)
    simulator.Initialize()
    system.arm_mode_input.FixValue(context, [float(mode)])
    system.joint_target_input.FixValue(context, START + 0.1)
    system.measured_position_input.FixValue(context, START + 0.2)
    simulator.AdvanceTo(2.0)
    np.testing.assert_allclose(position(system, context), target, atol=1e-3)
    assert flags(system, context) == expected


def test_inverse_kinematics_is_asked_only_when_it_moves_the_hand():
    limits = shared_control_model().command_limits(arm_joints("right"))
    system = ArmCommand(limits=limits, start_position=START)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.measured_position_input.FixValue(context, START)
    system.joint_target_input.FixValue(context, START)
    system.movement_input.FixValue(context, moving(None, 1))
    for mode in (ArmMode.LIMP, ArmMode.HELD, ArmMode.JOINTS):
        system.arm_mode_input.FixValue(context, [float(mode)])
        simulator.AdvanceTo(context.get_time() + 0.05)
    system.arm_mode_input.FixValue(context, [float(ArmMode.HAND)])
    assert flags(system, context) == [1, 0]
    with pytest.raises(RuntimeError, match="desired_velocity"):
        simulator.AdvanceTo(context.get_time() + 0.05)


def test_after_a_stop_it_goes_on_from_where_the_arm_was_held():
    system, simulator, context = make_rig(active=True)
    simulator.AdvanceTo(0.1)
    system.stop_reason_input.FixValue(context, [float(StopReason.LINK_TOO_CLOSE)])
    system.measured_position_input.FixValue(context, START - 0.05)
    simulator.AdvanceTo(0.2)
    np.testing.assert_array_equal(position(system, context), START - 0.05)
    system.stop_reason_input.FixValue(context, [0.0])
    simulator.AdvanceTo(0.215)
    assert np.abs(position(system, context) - (START - 0.05)).max() < 2e-3
