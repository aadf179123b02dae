import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.planning.collision.distance_grid import DistanceGrid, Region, sample

REGION = Region.of([-0.3, -0.2, 0.0], [0.3, 0.2, 0.4], 0.02)


def ball(points):
    return np.linalg.norm(points - [0.0, 0.0, 0.2], axis=-1) - 0.1


def test_a_region_covers_its_box():
    nodes = REGION.nodes()
    assert len(nodes) == np.prod(REGION.counts)
    np.testing.assert_allclose(nodes.min(axis=0), [-0.3, -0.2, 0.0])
    assert np.all(nodes.max(axis=0) >= np.array([0.3, 0.2, 0.4]) - 1e-12)
    assert nodes[1, 2] - nodes[0, 2] == 0.02, "the last coordinate changes fastest"


def test_a_plane_is_looked_up_exactly():
    normal = np.array([0.6, 0.0, 0.8])
    grid = DistanceGrid(REGION, (REGION.nodes() @ normal - 0.1)[None])
    points = np.random.default_rng(0).uniform(REGION.lower, [0.3, 0.2, 0.4], (500, 3))
    np.testing.assert_allclose(grid.distance(points.T), points @ normal - 0.1, atol=1e-6)


@given(st.integers(0, 10**6))
@settings(max_examples=20)
def test_a_curved_surface_is_looked_up_to_second_order(seed):
    grid = DistanceGrid(REGION, ball(REGION.nodes())[None])
    points = np.random.default_rng(seed).uniform(REGION.lower, [0.3, 0.2, 0.4], (200, 3))
    points = points[np.abs(ball(points)) < 0.08]
    # Half a cell's diagonal squared over twice the radius of curvature, and the differences'.
    np.testing.assert_allclose(grid.distance(points.T), ball(points), atol=0.008)
    assert np.abs(grid.distance(points.T) - ball(points)).mean() < 0.002


def test_layers_are_looked_up_by_number():
    values = ball(REGION.nodes())
    grid = DistanceGrid(REGION, np.stack((values, values + 1.0)))
    points = np.array([[0.2, 0.1], [0.0, 0.1], [0.2, 0.3]])
    both = grid.distance(points, np.array([0, 1]))
    np.testing.assert_allclose(both, grid.distance(points) + [0.0, 1.0], atol=1e-6)


def test_outside_its_region_a_grid_says_what_is_at_its_border():
    grid = DistanceGrid(REGION, ball(REGION.nodes())[None])
    outside, border = np.array([[5.0], [0.0], [0.2]]), np.array([[0.3], [0.0], [0.2]])
    assert grid.distance(outside) == grid.distance(border)


@given(st.integers(0, 10**6), st.floats(0.01, 0.15))
@settings(max_examples=30)
def test_distances_of_the_nodes_are_those_to_the_nearest_point(seed, cap):
    points = np.random.default_rng(seed).uniform(-0.5, 0.6, (6, 3))
    distance = np.linalg.norm(REGION.nodes()[:, None] - points, axis=2).min(axis=1)
    np.testing.assert_allclose(sample(REGION, points, cap), np.minimum(distance, cap), atol=1e-12)


def test_where_there_is_nothing_everything_is_far():
    assert np.all(sample(REGION, np.zeros((0, 3)), 0.08) == 0.08)
