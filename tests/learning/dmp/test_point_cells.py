import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.learning.dmp.point_cells import (
    PointCells,
    blended_directions,
    minimum_gaps,
    nearest_distances,
)


@given(st.integers(0, 2**32 - 1), st.integers(1, 300), st.floats(-3, 1), st.booleans())
@settings(max_examples=60, deadline=None)
def test_minimum_gaps_are_those_of_all_pairs(seed, count, exponent, jump):
    rng = np.random.default_rng(seed)
    points = rng.normal(scale=10.0**exponent, size=(count, 3))
    radii = rng.uniform(0.0, 0.1, 7)
    ways = rng.normal(scale=1.0 if jump else 0.01, size=(20, 1, 3)).cumsum(axis=0)
    centers = ways + rng.normal(scale=0.2, size=(7, 3))
    true = np.linalg.norm(centers[:, :, None] - points, axis=3).min(axis=2) - radii
    true = true.min(axis=1)
    cells = PointCells.of(points)
    np.testing.assert_allclose(minimum_gaps(centers, radii, cells, np.inf), true, atol=1e-12)
    near = np.where(true < 0.15, true, np.inf)
    np.testing.assert_allclose(minimum_gaps(centers, radii, cells, 0.15), near, atol=1e-12)


@pytest.mark.parametrize("points", [np.zeros((1, 3)), np.zeros((5, 3)), [[0, 0, 0], [9, 9, 9]]])
def test_points_in_one_place_and_far_apart_are_kept(points):
    points = np.array(points, dtype=float)
    cells = PointCells.of(points)
    assert sorted(map(tuple, cells.points)) == sorted(map(tuple, points))
    assert cells.first[-1] == len(points)
    assert minimum_gaps(points[-1:][None] + 0.3, np.zeros(1), cells, 1.0)[0] == pytest.approx(
        0.3 * np.sqrt(3.0)
    )


@given(st.integers(0, 2**32 - 1), st.integers(1, 200), st.floats(-3, 1), st.booleans())
@settings(max_examples=60, deadline=None)
def test_nearest_points_and_directions_are_those_of_all_pairs(seed, count, exponent, jump):
    rng = np.random.default_rng(seed)
    points = rng.normal(scale=10.0**exponent, size=(count, 3))
    places = rng.normal(scale=1.0 if jump else 0.01, size=(20, 3)).cumsum(axis=0)
    cells, kept = PointCells.of(points), min(12, count)
    away = places[:, None] - points
    far = np.linalg.norm(away, axis=2)
    np.testing.assert_allclose(nearest_distances(places, cells, np.inf), far.min(axis=1))
    bounded = np.where(far.min(axis=1) < 0.3, far.min(axis=1), np.inf)
    np.testing.assert_allclose(nearest_distances(places, cells, 0.3), bounded)
    order = np.argsort(far, axis=1)[:, :kept]
    far = np.take_along_axis(far, order, axis=1)
    away = np.take_along_axis(away, order[..., None], axis=1)
    weights = np.exp((far[:, :1] - far) / 0.006) / far
    blended = (weights[..., None] * away).sum(axis=1)
    directions = blended / np.linalg.norm(blended, axis=1, keepdims=True)
    distances, found = blended_directions(places, cells, kept, 0.006)
    np.testing.assert_allclose(distances, far[:, 0], atol=1e-12)
    np.testing.assert_allclose(found, directions, atol=1e-9)
