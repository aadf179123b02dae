import dataclasses

import numpy as np
import pytest

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.trajectories.retreat import (
    NewObstacleParams,
    carries_object,
    dilate_new_points,
    extrude_new_points_down,
    retreat_trajectory,
)

LIMITS = CommandLimits(np.full(5, -2.0), np.full(5, 2.0), np.full(5, 4.0), np.full(5, 10.0))
CAME = np.linspace(0.0, 1.0, 101)[:, None] * np.array([1.0, -0.5, 0.3, 0.2, 0.0])


def shell(points):
    return PointCloudDistance(points, extension=0.0)


def room_before(place):
    """Clearances that fall along the way, 5 cm at a place of it."""
    return lambda joints: 0.05 + 0.2 * (place - joints[:, 0])


def test_it_ends_at_the_nearest_posture_with_room_at_rest():
    path, duration = retreat_trajectory(CAME, CAME[-1], np.zeros(5), room_before(0.6), 0.05, LIMITS)
    assert path[-1, 0] == pytest.approx(0.6, abs=0.06)
    assert path[-1, 0] <= 0.6 + 1e-9
    step = duration / (len(path) - 1)
    np.testing.assert_allclose((path[-1] - path[-2]) / step, 0.0, atol=0.02)


def test_it_starts_where_the_arm_is_with_its_velocity_and_brakes():
    position, velocity = CAME[-1] + 0.01, np.array([0.6, -0.2, 0.1, 0.0, 0.0])
    path, duration = retreat_trajectory(CAME, position, velocity, room_before(0.8), 0.05, LIMITS)
    step = duration / (len(path) - 1)
    np.testing.assert_allclose(path[0], position)
    np.testing.assert_allclose((path[1] - path[0]) / step, velocity, atol=0.1)
    rates = np.diff(path, axis=0) / step
    assert np.all(np.abs(rates) <= LIMITS.velocity)
    assert np.all(np.abs(np.diff(rates, axis=0)) <= LIMITS.acceleration * step)
    assert path[:, 0].max() < position[0] + 0.1


@pytest.mark.parametrize("turns", [1.0, 4.0, 10.0])
def test_however_long_the_way_back_it_brakes_as_soon_as_it_can(turns):
    came = CAME * [1.0, turns, 1.0, 1.0, 1.0]
    limits = dataclasses.replace(LIMITS, position_lower=np.full(5, -20.0))
    velocity = np.array([1.5, 0.0, 0.0, 0.0, 0.0])
    path, duration = retreat_trajectory(came, came[-1], velocity, room_before(-1.0), 0.05, limits)
    if turns == 10.0:
        assert duration >= 2.0
    # Who brakes at a constant 7.5 rad/s² goes 0.15 rad too far.
    assert path[:, 0].max() - came[-1, 0] < 2.0 * 1.5**2 / (2 * 7.5)


def test_it_keeps_the_limits_of_the_joints():
    limits = dataclasses.replace(LIMITS, position_upper=np.array([1.05, 2.0, 2.0, 2.0, 2.0]))
    velocity = np.array([2.0, 0.0, 0.0, 0.0, 0.0])
    path, _ = retreat_trajectory(CAME, CAME[-1], velocity, room_before(0.5), 0.05, limits)
    assert path[:, 0].max() == 1.05


def test_without_room_anywhere_it_goes_where_there_is_most():
    path, _ = retreat_trajectory(CAME, CAME[-1], np.zeros(5), room_before(-1.0), 0.05, LIMITS)
    np.testing.assert_allclose(path[-1], CAME[0], atol=0.06)


def test_it_does_not_go_through_what_came_behind_the_arm():
    def room(joints):
        return np.where(np.abs(joints[:, 0] - 0.5) < 0.1, -0.02, 0.02 + 0.1 * (1.0 - joints[:, 0]))

    path, _ = retreat_trajectory(CAME, CAME[-1], np.zeros(5), room, 0.06, LIMITS)
    assert path[:, 0].min() > 0.6
    # From within it goes out all the same.
    path, _ = retreat_trajectory(CAME[:51], CAME[50], np.zeros(5), room, 0.06, LIMITS)
    assert path[-1, 0] < 0.6


def test_only_what_is_new_and_near_reaches_down():
    known = np.random.default_rng(0).uniform(-0.5, 0.5, (200, 3))
    new, far = np.array([[0.2, 0.0, 1.0]]), np.array([[2.0, 0.0, 1.0]])
    seen = np.concatenate((known + 0.005, new, far))
    cloud = extrude_new_points_down(seen, shell(known), np.array([0.0, 0.0, 0.8]))
    np.testing.assert_array_equal(cloud[:202], seen)
    below = cloud[202:]
    np.testing.assert_allclose(below[:, :2], [[0.2, 0.0]] * 5)
    assert below[:, 2].min() == pytest.approx(1.0 - NewObstacleParams().depth)


@pytest.mark.parametrize(("moving", "side"), [(False, 0.03), (True, 0.07)])
def test_who_plans_around_what_is_new_keeps_off_its_sides(moving, side):
    params = NewObstacleParams(dilation=0.03, moving_dilation=0.07)
    known = np.array([[0.0, 0.0, 0.8]])
    seen = np.array([[0.01, 0.0, 0.8], [0.2, 0.1, 0.9]])
    cloud = dilate_new_points(seen, shell(known), known[0], moving=moving, params=params)
    np.testing.assert_array_equal(cloud[:2], seen)
    off = cloud[2:] - seen[1]
    np.testing.assert_allclose(np.linalg.norm(off, axis=1), side)
    np.testing.assert_allclose(off.sum(axis=0), 0.0, atol=1e-12)
    assert len(off) == 4
    assert np.ptp(off[:, 2]) < 1e-12


@pytest.mark.parametrize("count", [0, 3])
def test_empty_clouds_are_no_trouble(count):
    cloud, nothing = np.ones((count, 3)), np.zeros((0, 3))
    assert len(extrude_new_points_down(cloud, shell(nothing), np.ones(3))) == 6 * count
    assert len(extrude_new_points_down(nothing, shell(np.ones((2, 3))), np.ones(3))) == 0


def test_what_the_goal_object_stands_on_ends_where_something_rises_from_it():
    x, y = (
        axis.ravel() for axis in np.meshgrid(np.arange(0.9, 1.3, 0.02), np.arange(-0.4, 0.4, 0.02))
    )
    top = np.column_stack((x, y, np.full(x.size, 0.74)))
    front = np.column_stack((np.full(40, 0.9), np.arange(-0.4, 0.4, 0.02), np.full(40, 0.72)))
    # A person's arm from before the table, whose fingers touch its front edge.
    arm = np.column_stack((np.linspace(0.3, 0.89, 30), np.zeros(30), np.linspace(0.5, 0.74, 30)))
    other = top + [0.0, 1.0, 0.0]
    cloud = np.concatenate((top, front, arm, other))
    carries = carries_object(cloud, np.array([0.98, -0.11, 0.74]))
    table = len(top) + len(front)
    assert carries[:table].all()
    assert not carries[table + len(arm) :].any()
    assert not carries[table : table + 20].any()
    assert not carries_object(cloud, np.array([0.98, -0.11, 1.2])).any()
