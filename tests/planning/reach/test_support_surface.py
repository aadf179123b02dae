import numpy as np
import pytest

from pepper_drake.planning.reach.support_surface import (
    SupportSurfaceParams,
    assumed_support,
    extrapolate_support_surface,
)

HEIGHT, EDGE = 0.75, 0.6
PARAMS = SupportSurfaceParams()


def seen(yaw=0.0, noise=0.0):
    """A table's top, of which a view from above its middle shows the shape of a fan."""
    x, y = np.meshgrid(np.arange(EDGE, 1.1, 0.01), np.arange(-0.7, 0.7, 0.01))
    x, y = x.ravel(), y.ravel()
    fan = np.abs(y) < 0.25 + 0.8 * (x - EDGE)
    points = np.column_stack((x, y, np.full(len(x), HEIGHT)))[fan]
    points += np.random.default_rng(0).normal(0.0, noise, points.shape)
    return points @ turn(yaw).T


def turn(yaw):
    return np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])


@pytest.mark.parametrize(("yaw", "noise"), [(0.0, 0.0), (0.7, 0.0), (0.0, 0.002)])
def test_a_table_goes_on_along_its_edge(yaw, noise):
    goal = turn(yaw) @ [EDGE + 0.1, 0.05, HEIGHT]
    with_extrapolated_surface = extrapolate_support_surface(
        seen(yaw, noise), goal, np.zeros(3), PARAMS
    ) @ turn(yaw)
    np.testing.assert_allclose(with_extrapolated_surface[:, 2], HEIGHT)
    assert with_extrapolated_surface[:, 0].min() == pytest.approx(EDGE, abs=0.03)
    for side in (-1.0, 1.0):
        beside = with_extrapolated_surface[with_extrapolated_surface[:, 1] * side > 0]
        corner = np.array([EDGE + 0.05, side * 0.6, HEIGHT])
        assert np.linalg.norm(beside - corner, axis=1).min() < 0.03, "the corner is covered"


def test_what_was_seen_is_not_supposed():
    points = seen()
    with_extrapolated_surface = extrapolate_support_surface(
        points, np.array([EDGE + 0.1, 0.0, HEIGHT]), np.zeros(3), PARAMS
    )
    inside = (
        np.abs(with_extrapolated_surface[:, 1])
        < 0.25 + 0.8 * (with_extrapolated_surface[:, 0] - EDGE) - 0.05
    )
    assert not inside.any()


@pytest.mark.parametrize(
    "points", [np.zeros((0, 3)), np.random.default_rng(0).uniform(0, 1, (200, 3)) * [1, 1, 0.5]]
)
def test_where_no_surface_was_seen_none_is_supposed(points):
    assert (
        len(extrapolate_support_surface(points, np.array([0.7, 0.0, HEIGHT]), np.zeros(3), PARAMS))
        == 0
    )


@pytest.mark.parametrize(
    "points", [np.zeros((0, 3)), np.array([[0.6, 0.0, HEIGHT + 0.1], [0.6, 0.2, HEIGHT]])]
)
def test_what_a_goal_object_stands_on_is_supposed_where_nothing_of_it_was_seen(points):
    goal, radius = np.array([0.6, -0.1, HEIGHT]), 0.033
    below = assumed_support(points, goal, radius, PARAMS)
    away = np.linalg.norm(below[:, :2] - goal[:2], axis=1)
    assert away.max() <= radius + PARAMS.rim
    assert away.max() > radius + PARAMS.rim - PARAMS.spacing
    assert away.min() < 1e-9
    np.testing.assert_allclose(below[:, 2], HEIGHT)


def test_where_something_of_it_was_seen_no_more_is_supposed():
    rim = np.array([[0.65, -0.1, HEIGHT - 0.01]])
    assert len(assumed_support(rim, np.array([0.6, -0.1, HEIGHT]), 0.033, PARAMS)) == 0
