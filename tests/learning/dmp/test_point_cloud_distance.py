import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.learning import PointCloudDistance

points = st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-0.3, 0.4)).map(np.array)


def table(height=0.0, step=0.02):
    grid = np.arange(-0.2, 0.2001, step)
    x, y = np.meshgrid(grid, grid)
    return np.column_stack((x.ravel(), y.ravel(), np.full(x.size, height)))


@given(points)
def test_distance_is_that_of_the_nearest_point_of_the_extended_cloud(position):
    cloud = np.random.default_rng(0).uniform(-0.3, 0.3, (60, 3))
    solid = np.concatenate([cloud - [0, 0, depth] for depth in np.linspace(0, 0.12, 7)])
    expected = np.linalg.norm(solid - position, axis=1).min()
    distance, normal = PointCloudDistance(cloud).distance_and_normal(position)
    assert distance == pytest.approx(expected)
    assert PointCloudDistance(cloud).distance(position) == pytest.approx(expected)
    assert np.linalg.norm(normal) == pytest.approx(1.0)


def test_normal_of_a_table_points_up_above_it_and_sideways_beside_it():
    field = PointCloudDistance(table())
    distance, normal = field.distance_and_normal([0.01, 0.01, 0.06])
    assert distance == pytest.approx(np.sqrt(0.06**2 + 2 * 0.01**2))
    np.testing.assert_allclose(normal, [0, 0, 1], atol=0.02)
    # 6 cm below the top, in front of the edge: without the extension it would point down.
    _, normal = field.distance_and_normal([-0.26, 0.0, -0.06])
    np.testing.assert_allclose(normal, [-1, 0, 0], atol=0.05)
    _, normal = PointCloudDistance(table(), extension=0.0).distance_and_normal([-0.26, 0.0, -0.06])
    assert normal[2] < -0.5


def test_blended_normal_worked_by_hand():
    # Two points at 0.03 and 0.036 m: weights 1 and exp(-1), each times its unit direction.
    field = PointCloudDistance([[0.0, 0.0, -0.03], [-0.036, 0.0, 0.0]], extension=0.0)
    _, normal = field.distance_and_normal([0.0, 0.0, 0.0])
    expected = np.array([np.exp(-1), 0.0, 1.0])
    np.testing.assert_allclose(normal, expected / np.linalg.norm(expected), atol=1e-9)


def test_density_does_not_change_distance_and_normal():
    coarse, fine = PointCloudDistance(table(step=0.02)), PointCloudDistance(table(step=0.01))
    for position in ([0.0, 0.0, 0.06], [-0.27, 0.0, 0.0], [0.05, 0.1, 0.08]):
        for one, other in zip(
            coarse.distance_and_normal(position), fine.distance_and_normal(position), strict=True
        ):
            np.testing.assert_allclose(one, other, atol=0.05)


def test_where_directions_cancel_out_the_normal_is_still_a_direction():
    field = PointCloudDistance([[0.1, 0.0, 0.0], [-0.1, 0.0, 0.0]], extension=0.0)
    distance, normal = field.distance_and_normal([0.0, 0.0, 0.0])
    assert distance == pytest.approx(0.1)
    assert np.linalg.norm(normal) == pytest.approx(1.0)
    _, normal = field.distance_and_normal([0.1, 0.0, 0.0])
    assert np.isfinite(normal).all()


def test_many_positions_at_once():
    field = PointCloudDistance(np.random.default_rng(0).uniform(-0.3, 0.3, (200, 3)))
    positions = np.random.default_rng(1).uniform(-0.3, 0.3, (4, 5, 3))
    distances, normals = field.distance_and_normal(positions)
    assert distances.shape == (4, 5)
    for index in np.ndindex(4, 5):
        distance, normal = field.distance_and_normal(positions[index])
        assert distances[index] == pytest.approx(float(distance))
        np.testing.assert_allclose(normals[index], normal, atol=1e-9)


@pytest.mark.parametrize("count", [0, 1, 5, 2000])
def test_one_position_gives_what_it_gives_among_many(count):
    rng = np.random.default_rng(count)
    field = PointCloudDistance(rng.uniform(-0.2, 0.2, (count, 3)))
    positions = np.array([0.2, 0.0, 0.1]) + np.cumsum(rng.normal(size=(200, 3)) * 0.004, axis=0)
    distances, normals = field.distance_and_normal(positions)
    for position, distance, normal in zip(positions, distances, normals, strict=True):
        alone = field.distance_and_normal(position)
        assert alone[0] == pytest.approx(float(distance), abs=1e-12)
        np.testing.assert_allclose(alone[1], normal, atol=1e-9)


@pytest.mark.parametrize("step", [0.003, 0.05, 0.3])
def test_the_distance_is_that_of_all_points_compared(step):
    rng = np.random.default_rng(7)
    cloud = rng.uniform(-0.3, 0.3, (1500, 3))
    field = PointCloudDistance(cloud, extension=0.0)
    position = np.zeros(3)
    for _ in range(30):
        position = np.clip(position + step * rng.normal(size=3), -0.5, 0.5)
        nearest = np.linalg.norm(cloud - position, axis=1).min()
        assert field.distance(position) == pytest.approx(nearest)
        within = field.distance(position, within=0.03)
        assert within == pytest.approx(nearest if nearest < 0.03 else np.inf)


def test_points_that_are_not_finite_are_left_out():
    field = PointCloudDistance([[0, 0, 0], [np.nan, 0, 0], [np.inf, 0, 0]])
    np.testing.assert_array_equal(field.points, [[0, 0, 0]])


def test_an_empty_cloud_is_infinitely_far():
    distance, normal = PointCloudDistance([]).distance_and_normal(np.zeros((2, 3)))
    assert np.all(np.isinf(distance))
    np.testing.assert_array_equal(normal, np.zeros((2, 3)))


def test_refuses_other_shapes():
    with pytest.raises(InputError, match=r"\(P, 3\)"):
        PointCloudDistance(np.zeros((3, 2)))


def test_what_is_nowhere_is_not_far_from_everything():
    field = PointCloudDistance(np.zeros((3, 3)))
    for ask in (field.distance, field.distance_and_normal):
        with pytest.raises(ValueError, match="finite"):
            ask([0.0, np.nan, 0.0])
