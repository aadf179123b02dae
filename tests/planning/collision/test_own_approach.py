import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.planning.collision.own_approach import own_approach_clearance

SLOWEST = 0.01
"""[m/s]."""
DISTANCES = st.floats(-0.1, 2.0)


@given(before=DISTANCES, gained=st.floats(0.0, 1.0), duration=st.floats(0.01, 0.5))
def test_a_robot_that_stands_or_goes_away_approaches_nothing(before, gained, duration):
    assert own_approach_clearance(before, before + gained, duration, SLOWEST) == np.inf


@given(before=DISTANCES, speed=st.floats(0.02, 1.0), duration=st.floats(0.01, 0.5))
def test_a_robot_that_goes_nearer_is_as_near_as_it_gets(before, speed, duration):
    after = before - speed * duration
    assert own_approach_clearance(before, after, duration, SLOWEST) == after


def test_slack_and_noise_are_no_approach():
    creeping = 0.9 * SLOWEST * 0.1
    assert own_approach_clearance(0.001, 0.001 - creeping, 0.1, SLOWEST) == np.inf


@pytest.mark.parametrize(("before", "after"), [(np.inf, np.inf), (0.5, np.inf), (np.inf, 0.5)])
def test_an_empty_cloud_before_or_after(before, after):
    assert own_approach_clearance(before, after, 0.1, SLOWEST) == after


@pytest.mark.parametrize(("before", "after"), [(0.1, np.nan), (np.nan, np.nan)])
def test_what_is_not_known_is_not_passed_over(before, after):
    assert np.isnan(own_approach_clearance(before, after, 0.1, SLOWEST))
