from types import SimpleNamespace

import numpy as np
import pytest

from pepper_drake.planning.trajectories.joint_trajectories import minimum_duration, minimum_jerk
from pepper_drake.planning.trajectories.trajectory_cost import (
    PathCostParams,
    TrajectoryCost,
    TrajectoryRating,
    wanted_clearance,
)
from pepper_drake.planning.trajectories.trajectory_search import (
    PathSearchParams,
    optimize_trajectory,
)

SAMPLES = 40
PARAMS, CLEARANCE = PathCostParams(), 0.020
VELOCITY, ACCELERATION = np.full(5, 1.0), np.full(5, 5.0)


def straight(goal=1.0):
    return goal * minimum_jerk(np.linspace(0.0, 1.0, SAMPLES))[:, None] * np.ones(5)


class Around:
    """Surroundings of one sphere whose gap is the first joint's distance from a wall."""

    def __init__(self, wall):
        self.wall = wall
        self.kinematics = SimpleNamespace(poses=self.poses)

    def poses(self, joints):
        return SimpleNamespace(hand_position=joints[:, :3])

    def approximate_distances(self, joints):
        return np.abs(joints[:, 0] - self.wall)[None]

    def approximate_distances_and_poses(self, joints):
        return self.approximate_distances(joints), self.poses(joints)


def cost_of(around, reference, duration=10.0):
    return TrajectoryCost(
        around,
        reference[None],
        duration=duration,
        velocity=VELOCITY,
        acceleration=ACCELERATION,
        params=PARAMS,
        clearance=CLEARANCE,
    )


def test_in_free_space_the_reference_costs_its_effort_only():
    path = straight()
    rating = cost_of(Around(9.0), path)(path[None])
    bend = np.diff(path, n=2, axis=0) / (10.0 / (SAMPLES - 1)) ** 2
    assert rating.cost[0] == pytest.approx(PARAMS.effort * np.sum(bend**2) / SAMPLES)
    assert rating.slack[0] > 1.0


def test_each_term_of_the_cost():
    path = straight()
    other = path + 0.3 * np.sin(np.linspace(0, np.pi, SAMPLES))[:, None] * [0, 1, 0, 0, 0]
    near = cost_of(Around(0.5), path, duration=1.0)(other[None])
    gaps = np.abs(other[:, 0] - 0.5)
    lack = np.maximum(CLEARANCE - gaps, 0.0)
    bend = np.diff(other, n=2, axis=0) * (SAMPLES - 1) ** 2
    expected = (
        PARAMS.proximity_weight * np.sum((lack / CLEARANCE) ** 2) / SAMPLES
        + PARAMS.slack * lack.max()
        + np.mean(np.sum((other - path)[:, :3] ** 2, axis=1)) / PARAMS.deviation**2
        + PARAMS.effort * np.sum(bend**2) / SAMPLES
        + PARAMS.duration_weight * (minimum_duration(other, VELOCITY, ACCELERATION) - 1.0)
    )
    assert near.cost[0] == pytest.approx(expected, rel=1e-5)
    assert near.slack[0] == pytest.approx((gaps - CLEARANCE).min(), abs=1e-6)


def test_close_to_start_and_goal_no_more_is_wanted_than_they_allow():
    wanted = wanted_clearance(np.array([[0.005, 0.5], [0.5, -0.01]]), 101, PARAMS, CLEARANCE)
    less = PARAMS.end_allowance
    np.testing.assert_allclose(wanted[0, 0], 0.005 - less, atol=1e-7)
    np.testing.assert_allclose(wanted[0, 20:], CLEARANCE, atol=1e-7)
    np.testing.assert_allclose(wanted[1, :71], CLEARANCE, atol=1e-7)
    np.testing.assert_allclose(wanted[1, -1], -0.01 - less, atol=1e-7)
    assert np.all(np.diff(wanted[0]) >= 0)


def test_a_reference_that_is_clear_stays_as_it_is():
    path = straight()
    found = optimize_trajectory(
        path,
        cost_of(Around(9.0), path),
        lower=np.full(5, -2.0),
        upper=np.full(5, 2.0),
        params=PathSearchParams(),
    )
    assert found.generations == 0
    np.testing.assert_array_equal(found.path, path)


class Pole:
    """Surroundings in the plane of the first two joints, with a round pole on the straight way."""

    def __init__(self):
        self.kinematics = SimpleNamespace(poses=lambda q: SimpleNamespace(hand_position=q[:, :3]))

    def approximate_distances(self, joints):
        return np.linalg.norm(joints[:, :2] - [0.5, 0.45], axis=1)[None] - 0.15

    def approximate_distances_and_poses(self, joints):
        return self.approximate_distances(joints), self.kinematics.poses(joints)


def around_the_pole(seed=0):
    path = straight()
    return optimize_trajectory(
        path,
        cost_of(Pole(), path),
        lower=np.full(5, -0.2),
        upper=np.full(5, 1.2),
        params=PathSearchParams(),
        seed=seed,
    )


def test_a_path_is_bent_around_what_is_in_the_way():
    found = around_the_pole()
    assert found.slack > PathSearchParams().slack
    assert Pole().approximate_distances(found.path).min() > CLEARANCE + PathSearchParams().slack
    np.testing.assert_array_equal(found.path[[0, -1]], straight()[[0, -1]])
    assert np.all((found.path >= -0.2) & (found.path <= 1.2))
    # Only the joints that meet the pole go another way.
    assert np.abs(found.path - straight())[:, 2:].max() < 0.25
    assert np.abs(found.path - straight())[:, :2].max() > 0.05


def test_the_same_seed_finds_the_same_path():
    np.testing.assert_array_equal(around_the_pole(3).path, around_the_pole(3).path)
    assert not np.array_equal(around_the_pole(3).path, around_the_pole(4).path)


def test_where_there_is_no_way_the_best_one_says_so():
    path = straight()

    def walled(paths):
        return TrajectoryRating(paths[..., 0].sum(axis=1), np.full(len(paths), -0.05))

    found = optimize_trajectory(
        path,
        walled,
        lower=np.full(5, -2.0),
        upper=np.full(5, 2.0),
        params=PathSearchParams(generations=3, population=8),
    )
    assert found.slack == -0.05
    assert found.cost < walled(path[None]).cost[0]
