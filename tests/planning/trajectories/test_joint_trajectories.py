import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.planning.trajectories.joint_trajectories import (
    minimum_duration,
    minimum_jerk,
    perturbation_basis,
    resampled,
    retarget,
    time_parameterize,
)


def wave(samples=60):
    s = np.linspace(0.0, 1.0, samples)[:, None]
    return np.sin(s * np.array([1.0, 2.0, 3.0, 1.5, 2.5]))


def test_minimum_jerk_leaves_and_arrives_at_rest():
    s = np.linspace(-0.5, 1.5, 2001)
    m = minimum_jerk(s)
    assert m[0] == 0.0
    assert m[-1] == 1.0
    assert minimum_jerk(np.array([0.5]))[0] == pytest.approx(0.5)
    rate = np.gradient(m, s)
    assert rate.max() == pytest.approx(1.875, rel=1e-4)
    assert np.abs(rate[np.abs(s) < 0.01]).max() < 5e-3


@given(st.integers(0, 10**6))
@settings(max_examples=20)
def test_a_shifted_path_starts_and_ends_where_asked(seed):
    start, goal = np.random.default_rng(seed).uniform(-1, 1, (2, 5))
    path = retarget(wave(), start, goal)
    np.testing.assert_allclose(path[0], start, atol=1e-12)
    np.testing.assert_allclose(path[-1], goal, atol=1e-12)


def test_a_path_shifted_to_its_own_ends_stays_as_it_is():
    path = wave()
    np.testing.assert_allclose(retarget(path, path[0], path[-1]), path, atol=1e-15)


def test_many_paths_are_shifted_at_once():
    goals = np.random.default_rng(0).uniform(-1, 1, (3, 5))
    together = retarget(np.stack([wave()] * 3), np.zeros(5), goals)
    for path, goal in zip(together, goals, strict=True):
        np.testing.assert_array_equal(path, retarget(wave(), np.zeros(5), goal))


def test_bumps_move_neither_end_nor_the_velocity_and_acceleration_there():
    N = perturbation_basis(8, 2001)
    assert N.shape == (2001, 8)
    np.testing.assert_allclose(N.max(axis=0), 1.0)
    rates, bends = np.diff(N, axis=0), np.diff(N, n=2, axis=0)
    assert np.abs(N[[0, -1]]).max() == 0.0
    assert np.abs(rates[[0, -1]]).max() < 1e-4 * np.abs(rates).max()
    assert np.abs(bends[[0, -1]]).max() < 0.02 * np.abs(bends).max()
    assert np.linalg.matrix_rank(N) == 8


def test_the_needed_duration_is_that_of_the_fastest_joint():
    s = np.linspace(0.0, 1.0, 1001)
    path = np.zeros((1001, 5))
    path[:, 2] = 1.2 * minimum_jerk(s)  # Peak rate 1.875, peak curvature 5.7735 (10 / sqrt 3).
    slow = np.array([1.0, 1.0, 0.5, 1.0, 1.0])
    assert minimum_duration(path, slow, np.full(5, 1e9)) == pytest.approx(1.2 * 1.875 / 0.5, 1e-3)
    weak = np.full(5, 2.0)
    expected = np.sqrt(1.2 * 10 / np.sqrt(3) / 2.0)
    assert minimum_duration(path, np.full(5, 1e9), weak) == pytest.approx(expected, 2e-3)
    both = minimum_duration(np.stack((path, 2 * path)), slow, np.full(5, 1e9))
    assert both[1] == pytest.approx(2 * both[0])


def test_resampling_keeps_the_ends_and_straight_lines():
    line = np.linspace(0.0, 1.0, 17)[:, None] * np.arange(1.0, 6.0)
    again = resampled(line, 40)
    np.testing.assert_allclose(again, np.linspace(0.0, 1.0, 40)[:, None] * np.arange(1.0, 6.0))


def test_corners_become_a_smooth_path_at_rest_at_both_ends():
    corners = np.array([[0.0] * 5, [1.0, 0.5, 0.0, 0.0, 0.0], [1.0, -0.5, 1.0, 0.0, 0.2]])
    path = time_parameterize(corners, 400)
    np.testing.assert_allclose(path[[0, -1]], corners[[0, -1]], atol=1e-12)
    rates = np.linalg.norm(np.diff(path, axis=0), axis=1)
    assert rates[0] < 0.05 * rates.max()
    assert rates[-1] < 0.05 * rates.max()
    off = np.linalg.norm(path - corners[1], axis=1).min()
    assert 0.0 < off < 0.15, "it passes near the corner, not through it"
