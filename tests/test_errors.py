import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.errors import InputError, one_line


@given(text=st.text())
def test_any_text_becomes_one_line_that_a_terminal_shows_as_it_is(text):
    shown = str(InputError(text))
    assert shown.isprintable()
    assert len(shown.splitlines()) <= 1
    if text.isprintable():
        assert shown == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a\nb", "a\\nb"),
        ("\x1b[2J", "\\x1b[2J"),
        ("\u202egnp.exe", "\\u202egnp.exe"),
        ("\ud800", "\\ud800"),
        ("größer", "größer"),
    ],
)
def test_what_would_move_the_cursor_is_shown_by_its_code(text, shown):
    assert one_line(text) == shown


def test_a_text_without_end_is_cut():
    assert len(one_line("x" * 10**7)) < 1100
    assert len(one_line("\0" * 10**7)) < 1100
