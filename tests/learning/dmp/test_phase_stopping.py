import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.learning.dmp.phase_stopping import PhaseStopping

LAW = PhaseStopping(rate=5.0, slowdown_gain=1000.0, coupling_gain=200.0, dead_zone=0.01)


def test_the_filter_is_the_exact_solution_of_its_equation():
    deviation = np.array([0.03, 0.0, 0.04])
    # 1 cm of the 5 cm is ignored; from rest, e(t) = (1 - exp(-alpha_e t)) d.
    error = np.zeros(3)
    for _ in range(30):
        error = LAW.error_after(error, deviation, 0.01)
    np.testing.assert_allclose(error, (1 - np.exp(-1.5)) * deviation * 0.8, atol=1e-12)
    one = LAW.error_after(np.zeros(3), deviation, 0.3)
    np.testing.assert_allclose(one, error, atol=1e-12)


def test_slowdown_and_coupling_by_hand():
    error = np.array([0.0, 0.03, 0.04])
    assert LAW.slowdown(error) == pytest.approx(2.5)
    np.testing.assert_allclose(LAW.coupling(error), [0.0, 6.0, 8.0])


@given(st.lists(st.floats(-0.2, 0.2), min_size=3, max_size=3))
def test_what_is_ignored_does_nothing_and_the_rest_is_continuous(values):
    deviation = np.array(values)
    error = LAW.error_after(np.zeros(3), deviation, 1e3)
    length = np.linalg.norm(deviation)
    assert np.linalg.norm(error) == pytest.approx(max(0.0, length - 0.01), abs=1e-9)


def test_an_error_that_is_over_is_forgotten():
    error = LAW.error_after(np.array([0.05, 0.0, 0.0]), np.zeros(3), 2.0)
    np.testing.assert_allclose(error, 0.0, atol=1e-5)
