import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.learning.phase import extended_tau, phase_at, relative_time_at


def test_phase_follows_its_equation():
    # x(s) = exp(-alpha s): at s = ln 2 / alpha it is one half.
    assert phase_at(0.0, 8.0) == 1.0
    assert phase_at(np.log(2) / 8.0, 8.0) == pytest.approx(0.5)


@given(st.floats(0, 3))
def test_relative_time_inverts_the_phase(s):
    assert relative_time_at(phase_at(s, 25 / 3), 25 / 3) == pytest.approx(s, abs=1e-12)


def test_duration_grows_in_proportion_to_the_goals_displacement():
    tau = extended_tau(2.0, 2.0, np.zeros(3), np.array([0.0, 0.03, 0.04]), 6.0)
    assert tau == pytest.approx(2.0 + 6.0 * 0.05)


def test_a_goal_within_three_millimetres_has_not_moved():
    assert extended_tau(2.0, 2.0, np.zeros(3), np.array([0.0, 0.0029, 0.0]), 6.0) == 2.0


def test_a_goal_that_creeps_counts_from_where_it_was_at_first():
    tau = 2.0
    for k in range(1, 11):
        tau = extended_tau(tau, 2.0, np.zeros(3), np.array([0.002 * k, 0.0, 0.0]), 1.0)
    assert tau == pytest.approx(2.02)


def test_time_that_was_given_is_not_taken_back():
    tau = extended_tau(2.0, 2.0, np.zeros(3), np.array([0.1, 0.0, 0.0]), 5.0)
    assert extended_tau(tau, 2.0, np.zeros(3), np.array([0.01, 0.0, 0.0]), 5.0) == tau == 2.5


@given(st.integers(0, 1000))
def test_a_goal_that_shakes_extends_the_duration_by_its_amplitude_only(seed):
    seen = np.random.default_rng(seed).normal(0.0, 0.002, (500, 3))
    tau = 2.0
    for goal in seen:
        tau = extended_tau(tau, 2.0, np.zeros(3), goal, 6.0)
    farthest = np.linalg.norm(seen, axis=1).max()
    assert tau == pytest.approx(2.0 + 6.0 * farthest)
