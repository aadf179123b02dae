import numpy as np
import pytest

from pepper_drake.benchmarking.metrics import demonstration_distance, path_length, rms_jerk
from pepper_drake.diagrams.factory import make_primitive


def test_the_length_of_a_path_is_the_sum_of_its_steps():
    corners = np.array([[0.0, 0.0, 0.0], [0.3, 0.4, 0.0], [0.3, 0.4, 1.2]])
    assert path_length(corners) == pytest.approx(0.5 + 1.2)
    assert path_length(corners[:1]) == 0.0


def test_the_jerk_of_a_cubic_is_its_third_derivative():
    times = np.arange(0.0, 1.0, 0.01)
    path = np.stack((2.0 * times**3, times**2, -1.0 * times**3), axis=1)
    assert rms_jerk(path, 0.01) == pytest.approx(np.hypot(12.0, 6.0), rel=1e-6)


def test_a_straight_steady_path_has_no_jerk_and_a_short_one_none_that_is_known():
    path = np.outer(np.arange(100), [0.001, 0.0, 0.002])
    assert rms_jerk(path, 0.01) == pytest.approx(0.0, abs=1e-6)
    assert np.isnan(rms_jerk(path[:10], 0.01))


@pytest.fixture(scope="module")
def primitive():
    return make_primitive(None, "right")


def undisturbed(primitive, shift=0.0, step=0.01):
    path = primitive.rollout(
        time_step=step,
        start=primitive.start + shift,
        goal=primitive.goal + shift,
        start_velocity=np.zeros(3),
    )
    return path.times, path.positions


def test_the_demonstrated_movement_is_like_itself_elsewhere_and_with_rest_after_it(primitive):
    times, positions = undisturbed(primitive, shift=np.array([0.05, -0.1, 0.02]))
    rested = np.concatenate((positions, np.repeat(positions[-1:], 120, axis=0)))
    assert demonstration_distance(primitive, positions, times[-1]) < 1e-4
    assert demonstration_distance(primitive, rested, times[-1]) < 1e-4


def test_likeness_does_not_ask_how_fast(primitive):
    _, positions = undisturbed(primitive)
    assert demonstration_distance(primitive, positions, 2 * primitive.duration, 0.02) < 1e-4


def test_likeness_is_equation_4_1(primitive):
    times, positions = undisturbed(primitive)
    # A bump that is zero at both ends, in one of three coordinates.
    bump = 0.01 * np.sin(np.pi * times / times[-1]) ** 2
    positions[:, 2] += bump
    by_hand = np.sqrt(np.sum(bump**2)) / 3
    assert demonstration_distance(primitive, positions, times[-1]) == pytest.approx(
        by_hand, rel=0.02
    )
