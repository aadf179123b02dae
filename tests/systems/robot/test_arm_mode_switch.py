import numpy as np
import pytest

from pepper_drake.systems.robot.arm_mode_switch import ArmMode, ArmModeSwitch


@pytest.fixture
def switch():
    system = ArmModeSwitch(time_constant=0.1, time_step=0.01)
    context = system.CreateDefaultContext()
    for name, value in (
        ("measured_position", 0.4),
        ("joint_target", 1.0),
        ("position_command", 0.2),
        ("hand_velocity", 0.7),
    ):
        system.GetInputPort(name).FixValue(context, np.full(5, value))

    def velocity(mode):
        system.mode_input.FixValue(context, [float(mode)])
        return system.desired_velocity_output.Eval(context)

    velocity.flags = lambda mode: (
        velocity(mode),
        [system.GetOutputPort(name).Eval(context)[0] for name in ("holding", "active", "moving")],
    )[1]
    velocity.system, velocity.context = system, context
    return velocity


def test_velocity_of_each_mode(switch):
    assert switch(ArmMode.LIMP) == pytest.approx(np.full(5, (0.4 - 0.2) / 0.04))
    assert switch(ArmMode.HELD) == pytest.approx(np.zeros(5))
    assert switch(ArmMode.JOINTS) == pytest.approx(np.full(5, (1.0 - 0.2) / 0.1))
    assert switch(ArmMode.HAND) == pytest.approx(np.full(5, 0.7))


def test_flags_of_each_mode(switch):
    assert switch.flags(ArmMode.LIMP) == [1, 0, 0]
    assert switch.flags(ArmMode.HELD) == [0, 0, 0]
    assert switch.flags(ArmMode.JOINTS) == [0, 0, 1]
    assert switch.flags(ArmMode.HAND) == [0, 1, 1]


def test_inverse_kinematics_is_asked_only_when_it_moves_the_hand():
    system = ArmModeSwitch()
    context = system.CreateDefaultContext()
    for name in ("measured_position", "joint_target", "position_command"):
        system.GetInputPort(name).FixValue(context, np.zeros(5))
    for mode in (ArmMode.LIMP, ArmMode.HELD, ArmMode.JOINTS):
        system.mode_input.FixValue(context, [float(mode)])
        assert system.desired_velocity_output.Eval(context) == pytest.approx(np.zeros(5))
    system.mode_input.FixValue(context, [float(ArmMode.HAND)])
    with pytest.raises(RuntimeError, match="hand_velocity"):
        system.desired_velocity_output.Eval(context)
