import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pepper_drake.errors import InputError
from pepper_drake.learning.dmp.scaling import (
    MotionFrame,
    check_scaling,
    scaled,
    scaling_matrix,
    scaling_offset,
    unscaled,
)

FRAME = MotionFrame(np.zeros(3), np.array([0.3, 0.0, 0.4]), np.array([0.3, 0.2, 0.5]))
vectors = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array)


def test_goal_scaling_is_the_reports():
    s = scaling_matrix("goal", FRAME, np.array([1.0, 2.0, 3.0]), np.array([2.0, 0.0, 3.5]))
    np.testing.assert_allclose(scaled(np.array([[1.0, 1.0, 1.0]]), s), [[1.0, -2.0, 0.5]])


def test_none_and_amplitude_do_not_depend_on_the_goal():
    assert scaling_matrix("none", FRAME, FRAME.start, FRAME.goal) is None
    s = scaling_matrix("amplitude", FRAME, np.ones(3), np.zeros(3))
    np.testing.assert_allclose(np.diag(s), FRAME.extent)


@given(vectors, vectors)
@example(np.array([0.64820852, 0.0, 0.14513892]), np.array([0.42593649, 0.0, -0.15119775]))
def test_rotation_dilation_takes_the_shown_way_to_the_wanted_one(start, goal):
    assume(np.linalg.norm(goal - start) > 1e-3)
    s = scaling_matrix("rotation_dilation", FRAME, start, goal)
    np.testing.assert_allclose(s @ (FRAME.goal - FRAME.start), goal - start, atol=1e-9)
    ratio = np.linalg.norm(goal - start) / 0.5
    np.testing.assert_allclose(s @ s.T, ratio**2 * np.eye(3), atol=1e-9)
    assert np.linalg.det(s) > 0


@given(vectors)
def test_rotation_is_the_smallest(direction):
    assume(np.linalg.norm(direction) > 1e-3)
    wanted = 0.5 * direction / np.linalg.norm(direction)
    s = scaling_matrix("rotation_dilation", FRAME, np.zeros(3), wanted)
    angle = np.arccos(np.clip(wanted @ FRAME.goal / 0.25, -1, 1))
    assert Rotation.from_matrix(s).magnitude() == pytest.approx(angle, abs=1e-6)


@pytest.mark.parametrize("goal", [[0.3, 0.0, 0.4], [0.0, 0.0, 0.5], [0.5, 0.0, 0.0]])
def test_half_a_turn_is_still_a_rotation(goal):
    frame = MotionFrame(np.zeros(3), np.array(goal), np.ones(3))
    s = scaling_matrix("rotation_dilation", frame, np.zeros(3), -np.array(goal))
    np.testing.assert_allclose(s @ np.array(goal), -np.array(goal), atol=1e-12)
    np.testing.assert_allclose(s @ s.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(s) == pytest.approx(1.0)


@given(vectors)
def test_unscaling_inverts(value):
    goal = np.array([0.2, -0.1, 0.4])
    for name in ("goal", "amplitude", "rotation_dilation"):
        s = scaling_matrix(name, FRAME, np.zeros(3), goal)
        np.testing.assert_allclose(
            unscaled(scaled(value[None], s), s, name), value[None], atol=1e-12
        )


def test_a_coordinate_without_way_and_motion_stays_zero():
    s = scaling_matrix("goal", FRAME, FRAME.start, FRAME.goal)
    values = np.array([[0.3, 0.0, 0.4]])
    np.testing.assert_allclose(unscaled(values, s, "goal"), [[1.0, 0.0, 1.0]])


def test_a_motion_that_the_scaling_cannot_express_is_refused():
    s = scaling_matrix("goal", FRAME, FRAME.start, FRAME.goal)
    with pytest.raises(InputError, match="ends where it starts"):
        unscaled(np.ones((1, 3)), s, "goal")


def test_gradual_starts_with_the_acceleration_shown():
    # At x = 1 the spring's pull changed by alpha beta (g - y0 - (g_d - y0_d)): b takes that back.
    start, goal = np.array([0.1, 0.0, 0.0]), np.array([0.5, 0.2, 0.4])
    b = scaling_offset("gradual", FRAME, start, goal, 8.0)
    np.testing.assert_allclose(b, -16.0 * ((goal - start) - FRAME.goal))
    assert scaling_offset("none", FRAME, start, goal, 8.0) is None


def test_unknown_names_are_refused():
    with pytest.raises(InputError, match="rotation_dilation"):
        check_scaling("size")
