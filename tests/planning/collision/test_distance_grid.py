import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.planning.collision.distance_grid import DistanceGrid, Region

REGION = Region.of([-0.3, -0.2, 0.0], [0.3, 0.2, 0.4], 0.02)


def of_layers(*layers):
    """A grid of distances that are known at all nodes."""
    nothing = PointCloudDistance(np.zeros((0, 3))), RigidTransform()
    return DistanceGrid(REGION, np.stack(layers), [nothing], cap=1.0)


def ball(points):
    return np.linalg.norm(points - [0.0, 0.0, 0.2], axis=-1) - 0.1


def at(grid, points, layer=0):
    """Distances (N,) of one layer at points (N, 3)."""
    return grid.distance(points[:, None], np.array([layer]))[:, 0]


def test_a_region_covers_its_box():
    nodes = REGION.nodes()
    assert len(nodes) == np.prod(REGION.counts)
    np.testing.assert_allclose(nodes.min(axis=0), [-0.3, -0.2, 0.0])
    assert np.all(nodes.max(axis=0) >= np.array([0.3, 0.2, 0.4]) - 1e-12)
    assert nodes[1, 2] - nodes[0, 2] == 0.02, "the last coordinate changes fastest"


def test_a_plane_is_looked_up_exactly():
    normal = np.array([0.6, 0.0, 0.8])
    grid = of_layers(REGION.nodes() @ normal - 0.1)
    points = np.random.default_rng(0).uniform(REGION.lower, [0.3, 0.2, 0.4], (500, 3))
    np.testing.assert_allclose(at(grid, points), points @ normal - 0.1, atol=1e-6)


@given(st.integers(0, 10**6))
@settings(max_examples=20)
def test_a_curved_surface_is_looked_up_to_second_order(seed):
    grid = of_layers(ball(REGION.nodes()))
    points = np.random.default_rng(seed).uniform(REGION.lower, [0.3, 0.2, 0.4], (200, 3))
    points = points[np.abs(ball(points)) < 0.08]
    # Half a cell's diagonal squared over twice the radius of curvature, and the differences'.
    np.testing.assert_allclose(at(grid, points), ball(points), atol=0.008)
    assert np.abs(at(grid, points) - ball(points)).mean() < 0.002


def test_layers_are_looked_up_by_number():
    values = ball(REGION.nodes())
    grid = of_layers(values, values + 1.0)
    points = np.array([[[0.2, 0.0, 0.2], [0.1, 0.1, 0.3]]])
    both = grid.distance(points, np.array([0, 1]))
    np.testing.assert_allclose(both[0], at(grid, points[0]) + [0.0, 1.0], atol=1e-6)


def test_outside_its_region_a_grid_says_what_is_at_its_border():
    grid = of_layers(ball(REGION.nodes()))
    outside, border = np.array([[5.0, 0.0, 0.2]]), np.array([[0.3, 0.0, 0.2]])
    assert at(grid, outside) == at(grid, border)


@given(st.integers(0, 10**6))
@settings(max_examples=20)
def test_what_is_measured_on_the_way_is_what_is_measured_before(seed):
    """The compiled look-up against the formula, gradients by numpy, at the border, too."""
    rng, cap = np.random.default_rng(seed), 0.12
    X_FT = RigidTransform(RollPitchYaw(rng.uniform(-1.0, 1.0, 3)), rng.uniform(-0.5, 0.5, 3))
    near, far = (rng.uniform([-0.3, -0.2, 0.0], [0.3, 0.2, 0.4], (n, 3)) for n in (5, 30))
    cloud, other = PointCloudDistance(near), PointCloudDistance((X_FT @ far.T).T, extension=0.0)

    def measure(places):
        there = (X_FT @ places.T).T
        return np.minimum(np.minimum(cloud.distance(places), other.distance(there)), cap)

    most = rng.uniform(0.0, cap, len(REGION.nodes()))
    clouds = (cloud, RigidTransform()), (other, X_FT)
    grid = DistanceGrid(REGION, np.stack((np.full(len(most), cap), most)), clouds, cap)
    points = rng.uniform([-0.32, -0.22, -0.02], [0.32, 0.22, 0.42], (60, 2, 3))
    found = np.concatenate([grid.distance(some, np.array([0, 1])) for some in points[:, None]])
    place = (points - REGION.lower) / REGION.spacing
    place = np.clip(place, 0.0, np.array(REGION.counts) - 1.0)
    assume(np.abs(place % 1.0 - 0.5).min() > 1e-5)  # Between two nodes rounding decides.
    node = np.rint(place).astype(int)
    for layer, values in enumerate(
        (measure(REGION.nodes()), np.minimum(most, measure(REGION.nodes())))
    ):
        values = values.reshape(REGION.counts)
        index = tuple(node[:, layer].T)
        expected = values[index]
        for axis, change in enumerate(np.gradient(values)):
            expected = expected + change[index] * (place - node)[:, layer, axis]
        np.testing.assert_allclose(found[:, layer], expected, atol=1e-6)


def test_only_what_is_looked_up_is_measured():
    clouds = (PointCloudDistance(np.array([[0.0, 0.0, 0.2]])), RigidTransform())
    grid = DistanceGrid(REGION, np.full((1, len(REGION.nodes())), 0.08), [clouds], cap=0.08)
    points = np.array([[0.0, 0.0, 0.2], [0.001, 0.0, 0.2], [0.02, 0.0, 0.2]])
    np.testing.assert_allclose(at(grid, points), at(grid, points))
    assert grid.arrays.ready.sum() == 2
    assert grid.arrays.measured.sum() == 12, "two nodes side by side and their neighbours"


def test_what_is_nowhere_has_no_distance():
    grid = of_layers(ball(REGION.nodes()))
    with pytest.raises(ValueError, match="finite"):
        at(grid, np.array([[0.0, np.nan, 0.2]]))
