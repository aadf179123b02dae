import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from pepper_drake.systems.robot.joint_command_interpolator import JointCommandInterpolator

PERIOD = 0.02


class Commands(LeafSystem):
    """New commands (2,) of even motion every period, after a first one that is far from zero."""

    def __init__(self):
        super().__init__()
        state = self.DeclareDiscreteState([1.0, -0.5])
        self.DeclareStateOutputPort("joint_position_command", state)
        self.DeclarePeriodicDiscreteUpdateEvent(PERIOD, 0.0, self._update)

    def _update(self, context, discrete_state):
        if context.get_time() > 0:
            command = discrete_state.get_mutable_vector(0).get_mutable_value()
            command += [0.04, -0.02]


@pytest.fixture
def simulator():
    builder = DiagramBuilder()
    commands = builder.AddSystem(Commands())
    servo = builder.AddSystem(JointCommandInterpolator(2, PERIOD))
    builder.Connect(commands.get_output_port(), servo.command_input)
    builder.ExportOutput(servo.get_output_port(), "desired_state")
    return Simulator(builder.Build())


def desired_state(simulator, time):
    simulator.AdvanceTo(time)
    return simulator.get_system().get_output_port().Eval(simulator.get_context())


def test_the_first_command_is_where_the_joints_stay_until_the_second(simulator):
    simulator.Initialize()
    for time in (0.0, 0.005, 0.015, PERIOD):
        np.testing.assert_array_equal(desired_state(simulator, time), [1.0, -0.5, 0.0, 0.0])


def test_half_the_way_in_half_the_period_and_the_rate_all_along(simulator):
    for n in range(1, 6):
        before = np.array([1.0, -0.5]) + (n - 1) * np.array([0.04, -0.02])
        for phase, share in ((0.002, 0.5), (0.009, 0.5), (0.011, 1.0), (0.019, 1.0)):
            expected = [*(before + share * np.array([0.04, -0.02])), 2.0, -1.0]
            state = desired_state(simulator, n * PERIOD + phase)
            np.testing.assert_allclose(state, expected, atol=1e-12)


def test_a_command_may_come_just_before_its_period_begins():
    servo = JointCommandInterpolator(1, PERIOD)
    simulator = Simulator(servo)
    context = simulator.get_mutable_context()
    for n in range(5):
        servo.command_input.FixValue(context, [0.1 * n])
        state = desired_state(simulator, n * PERIOD + 0.3 * PERIOD)
        np.testing.assert_allclose(state, [0.1 * (n - 0.5), 5.0] if n else [0, 0], atol=1e-12)
        state = desired_state(simulator, n * PERIOD + 0.9 * PERIOD)
        np.testing.assert_allclose(state, [0.1 * n, 5.0] if n else [0, 0], atol=1e-12)


def test_a_context_that_was_never_initialized_holds_what_is_commanded():
    servo = JointCommandInterpolator(3, PERIOD)
    context = servo.CreateDefaultContext()
    servo.command_input.FixValue(context, [0.3, 0.2, 0.1])
    state = servo.get_output_port().Eval(context)
    np.testing.assert_array_equal(state, [0.3, 0.2, 0.1, 0, 0, 0])


def test_a_joint_that_was_moved_goes_on_from_there_and_the_other_as_before(simulator):
    simulator.AdvanceTo(5 * PERIOD)
    servo = next(
        s for s in simulator.get_system().GetSystems() if isinstance(s, JointCommandInterpolator)
    )
    command = 1.0 + 5 * 0.04
    context = servo.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    servo.restart(context, [0], [command - 0.01])
    after = desired_state(simulator, 5 * PERIOD + 0.001)
    assert after[0] == pytest.approx(command - 0.005, abs=1e-9)
    assert after[2] == pytest.approx(0.01 / PERIOD)
    assert after[3] == pytest.approx(-0.02 / PERIOD)
