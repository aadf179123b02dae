import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.systems.analysis import Simulator

from pepper_drake.models.hands import HAND_SPEED
from pepper_drake.systems.robot.hand_motors import HandMotors, next_opening

OPENINGS = st.floats(0.0, 1.0)


@given(OPENINGS, st.floats(-3.0, 3.0), st.floats(0.0, 1.0))
def test_a_hand_never_leaves_its_range_nor_its_speed(opening, command, duration):
    after = next_opening(np.array([opening]), np.array([command]), duration)[0]
    assert 0.0 <= after <= 1.0
    assert abs(after - opening) <= HAND_SPEED * duration + 1e-12
    wanted = min(max(command, 0.0), 1.0)
    assert abs(wanted - after) <= abs(wanted - opening)


def test_a_hand_closes_in_its_time_and_one_without_a_command_stays():
    hands = HandMotors(0.02)
    simulator = Simulator(hands)
    context = simulator.get_mutable_context()
    simulator.AdvanceTo(0.1)
    opening = hands.GetOutputPort("opening")
    np.testing.assert_array_equal(opening.Eval(context), [0.5, 0.5])
    hands.GetInputPort("command").FixValue(context, [np.nan, 1.0])
    simulator.AdvanceTo(0.5)
    np.testing.assert_array_equal(opening.Eval(context), [0.5, 1.0])
    hands.GetInputPort("command").FixValue(context, [np.nan, 0.0])
    simulator.AdvanceTo(0.9)
    assert opening.Eval(context)[1] == pytest.approx(1.0 - 0.4 * HAND_SPEED, abs=HAND_SPEED * 0.021)
    simulator.AdvanceTo(1.3)
    np.testing.assert_array_equal(opening.Eval(context), [0.5, 0.0])
