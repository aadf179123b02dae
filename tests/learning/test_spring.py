import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from pepper_drake.learning.spring import (
    NODES,
    acceleration,
    advance,
    forced_response,
    forced_response_at,
    make_step,
    node_times,
    unforced_response,
)

ALPHA = 25.0
positive = st.floats(0.2, 5.0)


def integrate(state, goal, push, tau, time):
    """An independent witness: tau z' = alpha (beta (g - y) + tau g' - z) + u, tau y' = z."""

    def rates(t, yz):
        y, z = yz
        g = goal[0] + goal[1] * t
        return [z / tau, (ALPHA * (ALPHA / 4 * (g - y) + tau * goal[1] - z) + push(t)) / tau]

    z0 = [state[0], state[1] * tau]
    end = solve_ivp(rates, (0, time), z0, rtol=1e-12, atol=1e-14).y[:, -1]
    return np.array([end[0], end[1] / tau])


def take(state, goal, push, tau, time, steps):
    state, h = np.array(state)[:, None], time / steps
    for k in range(steps):
        line = np.array([[goal[0] + goal[1] * k * h], [goal[1]]])
        inputs = push(h * (k + NODES))[:, None] / tau**2
        state = advance(state, line, inputs, make_step(tau, h, ALPHA), h)
    return state[:, 0]


def test_acceleration_worked_by_hand():
    # tau 2, alpha 4, beta 1: z = tau y' = 6, tau z' = 4 (1 (5 - 1) + 2 * 0.5 - 6) + 8 = 4, y'' = 1.
    found = acceleration(
        np.array([[1.0], [3.0]]), np.array([[5.0], [0.5]]), np.array([8.0]), 2.0, 4.0
    )
    np.testing.assert_allclose(found, [1.0])


@settings(max_examples=25)
@given(st.floats(-1, 1), st.floats(-2, 2), st.floats(-1, 1), st.floats(-1, 1), positive)
def test_one_step_is_exact_without_input_however_long(y, v, g, g_velocity, tau):
    found = take([y, v], [g, g_velocity], lambda t: 0 * t, tau, 1.5 * tau, 1)
    expected = integrate([y, v], [g, g_velocity], lambda t: 0 * t, tau, 1.5 * tau)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def test_input_is_integrated_with_sixth_order():
    def push(t):
        return 30 * np.sin(9 * t)

    expected = integrate([0.1, -0.2], [0.3, 0.0], push, 1.3, 0.8)
    errors = [
        np.abs(take([0.1, -0.2], [0.3, 0.0], push, 1.3, 0.8, n) - expected).max() for n in (8, 16)
    ]
    assert errors[1] < errors[0] / 40
    assert errors[1] < 1e-6


def test_constant_input_moves_the_rest_position():
    state = take([0.0, 0.0], [0.0, 0.0], lambda t: 0 * t + 1.0, 1.0, 5.0, 200)
    np.testing.assert_allclose(state, [4 / ALPHA**2, 0.0], atol=1e-9)


def test_filter_is_the_recursion():
    rng = np.random.default_rng(0)
    inputs = rng.normal(size=(50, 4, 3))
    states = [np.zeros((2, 3))]
    for k in range(50):
        step = make_step(1.0, 0.02, ALPHA)
        states.append(advance(states[-1], np.zeros((2, 3)), inputs[k], step, 0.02))
    found = forced_response(inputs, 0.02, ALPHA)
    np.testing.assert_allclose(np.moveaxis(found, 1, 0), states, atol=1e-13)


def test_uneven_steps_give_the_same_motion():
    def push(s):
        return np.stack((np.sin(5 * s), np.cos(3 * s)), axis=-1)

    even = np.linspace(0, 1, 101)
    rng = np.random.default_rng(1)
    uneven = np.sort(np.concatenate((even[::10], rng.uniform(0, 1, 90))))
    smooth = forced_response_at(push(node_times(even)), even, ALPHA)
    rough = forced_response_at(push(node_times(uneven)), uneven, ALPHA)
    shared = np.searchsorted(uneven, even[::10])
    np.testing.assert_allclose(rough[:, shared], smooth[:, ::10], atol=1e-8)


@pytest.mark.parametrize("s", [0.0, 0.3, 1.0])
def test_unforced_response_is_that_of_the_equation(s):
    found = unforced_response(np.array([s]), ALPHA)[:, 0] @ [0.2, -0.7]
    expected = integrate([0.2, -0.7], [0.0, 0.0], lambda t: 0.0, 1.0, max(s, 1e-12))
    np.testing.assert_allclose(found, expected, atol=1e-10)
