import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.trajectories import PiecewisePolynomial

from pepper_drake.systems.robot.triggered_trajectory import TriggeredTrajectory

# 0.3 s at rest, then a straight line of two coordinates over 1 s, then rest.
BREAKS = [0.3, 1.3]
PATH = PiecewisePolynomial.FirstOrderHold(BREAKS, np.array([[0.0, 0.1], [0.2, 0.0]]))


def make_rig(trigger):
    system = TriggeredTrajectory(PATH)
    simulator = Simulator(system)
    system.trigger_input.FixValue(simulator.get_mutable_context(), [trigger])
    return system, simulator, simulator.get_mutable_context()


def desired(system, context):
    return system.get_output_port().Eval(context)


def test_without_the_trigger_it_stays_at_the_start():
    system, simulator, context = make_rig(0.0)
    simulator.AdvanceTo(3.0)
    np.testing.assert_array_equal(desired(system, context), [0, 0.2, 0, 0])


def test_it_plays_from_the_trigger_on_and_does_not_stop_when_the_trigger_does():
    system, simulator, context = make_rig(0.0)
    simulator.AdvanceTo(1.0)
    system.trigger_input.FixValue(context, [1.0])
    simulator.AdvanceTo(1.1)
    system.trigger_input.FixValue(context, [0.0])
    # The trigger is seen at the tick of 1.0 s; half of the path is over 0.8 s later.
    simulator.AdvanceTo(1.8)
    np.testing.assert_allclose(desired(system, context), [0.05, 0.1, 0.1, -0.2], atol=1e-9)
    simulator.AdvanceTo(4.0)
    np.testing.assert_allclose(desired(system, context), [0.1, 0, 0, 0], atol=1e-12)


def test_the_rate_is_that_of_the_value():
    system, simulator, context = make_rig(1.0)
    values, rates = [], []
    for k in range(1, 150):
        simulator.AdvanceTo(0.01 * k + 0.005)
        state = desired(system, context)
        values.append(state[:2])
        rates.append(state[2:])
    steps = np.diff(values, axis=0) / 0.01
    inside = slice(40, 120)
    np.testing.assert_allclose(steps[inside], rates[inside], atol=1e-6)


def test_nothing_is_fed_through():
    system = TriggeredTrajectory(PATH)
    assert not system.HasAnyDirectFeedthrough()


@pytest.mark.parametrize("reset", [True, False])
def test_another_context_begins_anew(reset):
    system, simulator, context = make_rig(1.0)
    simulator.AdvanceTo(1.0)
    fresh = system.CreateDefaultContext() if reset else context.Clone()
    system.trigger_input.FixValue(fresh, [0.0])
    np.testing.assert_array_equal(
        desired(system, fresh), [0, 0.2, 0, 0] if reset else desired(system, context)
    )
