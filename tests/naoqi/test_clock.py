import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.naoqi.clock import (
    ClockSample,
    MeasurementHistory,
    clock_offset,
    join_time,
    split_time,
)


@given(st.floats(1e9, 2e9))
def test_a_time_survives_seconds_and_microseconds(time):
    seconds, microseconds = split_time(time)
    assert 0 <= microseconds < 1_000_000
    assert join_time(seconds, microseconds) == pytest.approx(time, abs=1e-6)


@given(
    true_offset=st.floats(-1e6, 1e6),
    delays=st.lists(st.tuples(st.floats(0, 0.2), st.floats(0, 0.2)), min_size=1, max_size=8),
)
def test_the_true_offset_lies_within_the_bound(true_offset, delays):
    samples, now = [], 100.0
    for there, back in delays:
        samples.append(ClockSample(now, now + there + back, now + there + true_offset))
        now += 1.0
    found = clock_offset(samples)
    assert abs(found.offset - true_offset) <= found.bound + 1e-9
    assert found.bound == pytest.approx(min(a + b for a, b in delays) / 2, abs=1e-9)


def test_a_clock_that_was_not_asked_or_goes_backwards_is_refused():
    with pytest.raises(ValueError, match="was not asked"):
        clock_offset([])
    with pytest.raises(ValueError, match="went backwards"):
        clock_offset([ClockSample(2.0, 1.0, 5.0)])


@given(st.floats(0.0, 1.98))
def test_history_interpolates_what_changed_evenly(time):
    history = MeasurementHistory(span=2.0)
    for k in range(100):
        history.add(0.02 * k, [0.02 * k, 5.0 - 0.02 * k])
    np.testing.assert_allclose(history.at(time), [time, 5.0 - time], atol=1e-12)


def test_history_knows_nothing_outside_itself():
    history = MeasurementHistory(span=1.0)
    assert history.at(0.0) is None
    assert history.newest() is None
    for k in range(101):
        history.add(0.02 * k, [k])
    assert history.at(0.9) is None
    assert history.at(2.1) is None
    assert history.at(float("nan")) is None
    history.add(1.5, [77.0])
    assert history.newest()[0] == 2.0
