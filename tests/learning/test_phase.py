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
    known = np.zeros(3)
    tau, later = extended_tau(2.0, known, np.array([0.0, 0.03, 0.04]), 6.0)
    assert tau == pytest.approx(2.0 + 6.0 * 0.05)
    np.testing.assert_array_equal(later, [0.0, 0.03, 0.04])


def test_a_goal_that_trembles_does_not_extend_the_duration():
    known = np.zeros(3)
    tau, later = extended_tau(2.0, known, np.array([0.0, 0.0029, 0.0]), 6.0)
    assert tau == 2.0
    assert later is known


def test_a_goal_that_creeps_counts_from_where_it_last_counted():
    tau, known = 2.0, np.zeros(3)
    for k in range(1, 11):
        tau, known = extended_tau(tau, known, np.array([0.002 * k, 0.0, 0.0]), 1.0)
    assert tau == pytest.approx(2.02)
