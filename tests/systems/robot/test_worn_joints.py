import numpy as np
from pydrake.systems.analysis import Simulator

from pepper_drake.systems.robot.worn_joints import CommandLatency, JointBacklash


def test_commands_come_as_many_periods_later():
    system = CommandLatency([5.0, 6.0], 2, 0.02)
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    port = system.GetOutputPort("delayed_command")
    np.testing.assert_array_equal(port.Eval(context), [5.0, 6.0])
    system.command_input.FixValue(context, [0.0, 0.0])
    simulator.Initialize()
    came = []
    for tick in range(8):
        system.command_input.FixValue(context, [float(tick), -float(tick)])
        simulator.AdvanceTo((tick + 0.5) * 0.02)
        came.append(port.Eval(context)[0])
    assert came == [0, 0, 1, 2, 3, 4, 5, 6]


def follow(motor, backlash=0.1):
    """The joint behind a motor that goes through positions, and how far it is behind."""
    system = JointBacklash([backlash])
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.motor_input.FixValue(context, [motor[0], 0.0])
    simulator.Initialize()
    joints, gaps = [], []
    for tick, position in enumerate(motor):
        system.motor_input.FixValue(context, [position, 0.0])
        joints.append(system.GetOutputPort("joint_state").Eval(context)[0])
        gaps.append(system.GetOutputPort("gap").Eval(context)[0])
        simulator.AdvanceTo(0.01 * (tick + 1))
    return np.array(joints), np.array(gaps)


def test_a_joint_follows_half_of_the_slack_behind_and_stays_on_the_way_back():
    motor = np.concatenate((np.linspace(0, 1, 50), np.linspace(1, 0.5, 50)))
    joints, gaps = follow(motor)
    np.testing.assert_allclose(joints[49], 0.95)
    turned = motor[50:] > 0.9
    np.testing.assert_allclose(joints[50:][turned], 0.95)
    np.testing.assert_allclose(joints[-1], 0.55)
    np.testing.assert_allclose(gaps, motor - joints, atol=1e-12)
    assert np.abs(gaps).max() <= 0.05 + 1e-12


def test_no_slack_changes_nothing():
    motor = np.sin(np.linspace(0, 6, 80))
    joints, gaps = follow(motor, backlash=0.0)
    np.testing.assert_allclose(joints, motor, atol=1e-15)
    np.testing.assert_allclose(gaps, 0, atol=1e-15)


def test_a_joint_has_no_velocity_while_the_slack_is_crossed():
    system = JointBacklash([0.1])
    simulator = Simulator(system)
    context = simulator.get_mutable_context()
    system.motor_input.FixValue(context, [0.0, 0.0])
    simulator.Initialize()
    port = system.GetOutputPort("joint_state")
    system.motor_input.FixValue(context, [0.03, 2.0])
    assert port.Eval(context)[1] == 0.0
    system.motor_input.FixValue(context, [0.06, 2.0])
    assert port.Eval(context)[1] == 2.0
    system.motor_input.FixValue(context, [0.06, -2.0])
    assert port.Eval(context)[1] == 0.0


def test_outputs_depend_on_what_is_declared(ports):
    system = JointBacklash([0.1, 0.1])
    first, second = {"motor_state": [0.0, 0, 1, 1]}, {"motor_state": [1.0, 0, 1, 1]}
    changed = ports(system).changes(first, second)
    assert changed == {("motor_state", "joint_state")}
    system = CommandLatency([0.0], 1, 0.02)
    assert ports(system).changes({"command": [0.0]}, {"command": [1.0]}) == set()
