import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.common.value import Value

from pepper_drake.systems.guiding.gamepad_velocity import (
    GamepadParams,
    GamepadState,
    GamepadVelocity,
    gamepad_velocity,
)

PARAMS = GamepadParams(speed=0.4, turn_rate=2.0, dead_zone=0.2, exponent=2.0)


def buttons(*pressed):
    return tuple(1.0 if k in pressed else 0.0 for k in range(17))


@pytest.mark.parametrize(
    ("axes", "pressed", "expected"),
    [
        ((0, -1, 0, 0), (), [0, 0, 0, 0.4, 0, 0]),
        ((-1, 0, 0, 0), (), [0, 0, 0, 0, 0.4, 0]),
        ((0, 0, 0, -1), (), [0, 0, 0, 0, 0, 0.4]),
        ((0, 0, -1, 0), (), [0, 0, 2, 0, 0, 0]),
        ((0, 0, 0, 0), (5,), [2, 0, 0, 0, 0, 0]),
        ((0, 0, 0, 0), (4, 13), [-2, 2, 0, 0, 0, 0]),
        # Half way between the dead zone and the end: a quarter of the speed.
        ((0, -0.6, 0, 0), (), [0, 0, 0, 0.1, 0, 0]),
        ((0.19, -0.19, 0.1, -0.1), (), np.zeros(6)),
    ],
)
def test_sticks_and_buttons_by_hand(axes, pressed, expected):
    state = GamepadState.of(axes, buttons(*pressed))
    np.testing.assert_allclose(gamepad_velocity(state, PARAMS), expected, atol=1e-12)


@given(st.lists(st.floats(), max_size=6), st.lists(st.floats(), max_size=18))
def test_whatever_a_pad_says_the_velocity_is_finite_and_limited(axes, pressed):
    velocity = gamepad_velocity(GamepadState.of(axes, pressed), PARAMS)
    assert np.all(np.abs(velocity[:3]) <= 2.0)
    assert np.all(np.abs(velocity[3:]) <= 0.4)


def test_the_system_is_the_function_and_rests_without_a_pad():
    system = GamepadVelocity(PARAMS)
    context = system.CreateDefaultContext()
    system.gamepad_input.FixValue(context, Value[object](GamepadState()))
    np.testing.assert_array_equal(system.velocity_output.Eval(context), np.zeros(6))
    state = GamepadState.of((0.5, -0.7, 0.9, 0.2), buttons(4))
    system.gamepad_input.FixValue(context, Value[object](state))
    np.testing.assert_array_equal(
        system.velocity_output.Eval(context), gamepad_velocity(state, PARAMS)
    )
