import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.systems.faults.fault import (
    KINDS,
    SIGNALS,
    Fault,
    parse_fault,
    parse_faults,
    sensible_faults,
)


def test_a_fault_says_signal_kind_start_and_duration():
    assert parse_fault("depth:stuck@4+2.5") == Fault("depth", "stuck", 4.0, 2.5)
    assert parse_fault("cloud:off@0").duration == math.inf
    assert math.isnan(parse_fault("encoders:garbage@reach+0.1").start)


@given(
    pair=st.sampled_from(sensible_faults()),
    start=st.integers(0, 60) | st.just(math.nan),
    duration=st.sampled_from([0.5, 3.0, math.inf]),
)
def test_what_is_written_is_read_again(pair, start, duration):
    fault = Fault(*pair, start, duration)
    again = parse_fault(str(fault))
    assert str(again) == str(fault)
    assert again.signal in SIGNALS
    assert again.sentence()


@pytest.mark.parametrize(
    ("text", "part"),
    [
        ("depth", "SIGNAL:KIND@START"),
        ("depth:stuck", "SIGNAL:KIND@START"),
        ("deph:stuck@1", 'did you mean "depth"'),
        ("depth:frozen@1", '"frozen"'),
        ("depth:stuck@soon", 'or "reach"'),
        ("depth:stuck@-1", "zero or more"),
        ("depth:stuck@nan", "zero or more"),
        ("depth:stuck@1+", "duration"),
        ("depth:stuck@1+0", "for no time"),
        ("depth:stuck@inf", "zero or more"),
        ("actuators:garbage@1", "makes no sense"),
        ("planner:noisy@1", "makes no sense"),
        ("planner:stuck@reach", "makes no sense"),
    ],
)
def test_what_is_no_fault_is_refused_in_one_sentence(text, part):
    with pytest.raises(InputError) as error:
        parse_fault(text)
    assert part in str(error.value)
    assert text in str(error.value)
    assert "\n" not in str(error.value)


def test_a_signal_has_one_fault():
    assert len(parse_faults(["depth:off@1", "goal:off@1"])) == 2
    with pytest.raises(InputError, match="both concern depth"):
        parse_faults(["depth:off@1", "depth:stuck@3"])


def test_twelve_signals_fail_in_eight_ways():
    assert len(SIGNALS) == 12
    assert len(KINDS) == 8
    assert len(sensible_faults()) == 12 * 8 - 4
