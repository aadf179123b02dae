import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.planning.safety.command_check import StopReason
from pepper_drake.planning.safety.contact_detection import ContactParams
from pepper_drake.planning.safety.safe_command import SafeCommand, SafeCommandLayout


def rows(count):
    return st.lists(st.lists(st.floats(-3, 3), min_size=4, max_size=4), max_size=count).map(
        lambda values: tuple(np.array(row) for row in values)
    )


@st.composite
def commands(draw):
    row = st.lists(st.floats(-3, 3), min_size=4, max_size=4).map(np.array)
    return SafeCommand(
        draw(row),
        draw(row),
        draw(st.none() | row),
        draw(st.booleans()),
        draw(st.sampled_from(StopReason)),
        draw(st.integers(-1, 3)),
        draw(st.none() | row),
        draw(rows(3)),
        draw(rows(5)),
        np.array(draw(st.lists(st.integers(0, 9), min_size=4, max_size=4)), dtype=np.intp),
        draw(row),
        draw(row | st.just(np.full(4, np.nan)) | st.just(np.full(4, np.inf))),
    )


@given(commands())
def test_what_is_written_as_numbers_is_read_again(command):
    layout = SafeCommandLayout(4, sent=3, measured=5)
    read = layout.from_vector(layout.to_vector(command))
    for field in dataclasses.fields(SafeCommand):
        mine, theirs = getattr(command, field.name), getattr(read, field.name)
        assert (mine is None) == (theirs is None), field.name
        if mine is not None:
            np.testing.assert_array_equal(np.array(mine), np.array(theirs), err_msg=field.name)


def test_the_layout_holds_as_much_as_a_comparison_keeps():
    params = ContactParams(latency=0.04, back_off=0.1)
    layout = SafeCommandLayout.of(4, params, 0.02)
    command = SafeCommand.at_rest(np.zeros(4))
    for _ in range(20):
        command = command.compared(np.zeros(4), params, 0.02)
        assert len(layout.to_vector(command)) == len(
            layout.to_vector(SafeCommand.at_rest(np.ones(4)))
        )
    assert len(command.sent) == layout.sent
    assert len(command.measured) == layout.measured


def test_without_a_comparison_nothing_is_kept():
    assert SafeCommandLayout.of(4, None, 0.02) == SafeCommandLayout(4)
    with pytest.raises(ValueError, match="reshape"):
        SafeCommandLayout(4).from_vector(np.zeros(7))
