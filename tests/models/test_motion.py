import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.models import goal_motion, load_path
from pepper_drake.models.motion import path_trajectory


@pytest.mark.parametrize(
    ("direction", "arm", "expected"),
    [
        ("up", "right", [0, 0, 0.08]),
        ("aside", "right", [0, -0.08, 0]),
        ("aside", "left", [0, 0.08, 0]),
        ("away", "left", [0.08, 0, 0]),
    ],
)
def test_goal_motion_goes_its_way_from_rest_to_rest(direction, arm, expected):
    path = path_trajectory(goal_motion(direction, arm, start=2.0, duration=1.0))
    np.testing.assert_allclose(path.value(0.0).ravel(), 0.0)
    np.testing.assert_allclose(path.value(2.5).ravel(), np.array(expected) / 2, atol=1e-12)
    np.testing.assert_allclose(path.value(9.0).ravel(), expected, atol=1e-12)
    velocity = path.MakeDerivative()
    for time in (2.0, 3.0):
        np.testing.assert_allclose(velocity.value(time).ravel(), 0.0, atol=1e-12)
    # A cubic from rest to rest over 1 s peaks at 1.5 times its mean velocity.
    np.testing.assert_allclose(velocity.value(2.5).ravel(), 1.5 * np.array(expected), atol=1e-12)


@given(st.lists(st.floats(-0.3, 0.3), min_size=2, max_size=6))
def test_a_path_passes_its_rows_and_does_not_overshoot(heights):
    rows = [[0.5 * k, 0.0, 0.0, z] for k, z in enumerate(heights)]
    path = path_trajectory(rows)
    for time, *offset in rows:
        np.testing.assert_allclose(path.value(time).ravel(), offset, atol=1e-12)
    for k in range(len(rows) - 1):
        low, high = sorted(heights[k : k + 2])
        z = [path.value(t)[2, 0] for t in np.linspace(0.5 * k, 0.5 * k + 0.5, 21)]
        assert min(z) >= low - 1e-9
        assert max(z) <= high + 1e-9


def test_goal_motion_refuses_what_it_does_not_know():
    with pytest.raises(InputError, match="up, aside, away"):
        goal_motion("sideways", "right")
    with pytest.raises(InputError, match="positive duration"):
        goal_motion("up", "right", duration=0.0)


def test_path_file(tmp_path):
    file = tmp_path / "path.txt"
    file.write_text("# time x y z\n0 0 0 0\n\n1.5 0.1 0 0.05  # there\n")
    assert load_path(file) == [[0, 0, 0, 0], [1.5, 0.1, 0, 0.05]]


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("0 0 0 0\n1 0 0\n", "line 2 has 3 columns"),
        ("0 0 0 0\n1 0 x 0\n", "line 2 must hold four numbers"),
        ("0 0 0 0\n1 0 nan 0\n", "line 2 must hold finite numbers"),
        ("1 0 0 0\n# back\n0.5 0 0 0\n", "line 3: time must not be negative and must increase"),
        ("-1 0 0 0\n0.5 0 0 0\n", "line 1: time"),
        ("0 0 0 0\n", "has 1 rows"),
    ],
)
def test_bad_path_files(tmp_path, text, sentence):
    file = tmp_path / "path.txt"
    file.write_text(text)
    with pytest.raises(InputError, match=sentence):
        load_path(file)
    with pytest.raises(InputError, match="no such file"):
        load_path(tmp_path / "none.txt")
