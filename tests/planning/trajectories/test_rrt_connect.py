import itertools

import numpy as np
import pytest

from pepper_drake.planning.trajectories.rrt_connect import RrtConnectParams, rrt_connect

LOWER, UPPER = np.full(5, -1.0), np.full(5, 1.0)
START, GOAL = np.full(5, -0.5), np.full(5, 0.5)


def wall_with_a_door(q, padding=0.05):
    """A wall between start and goal, open where the second joint is above 0.5.

    With a padding of the resolution: between the postures that were checked is one of half that.
    """
    return (np.abs(q[:, 0]) > 0.1 + padding) | (q[:, 1] > 0.5 + padding)


def plan(free, goals=GOAL[None], **options):
    return rrt_connect(
        START, goals, free, lower=LOWER, upper=UPPER, params=RrtConnectParams(**options)
    )


def along(corners):
    shares = np.linspace(0.0, 1.0, 60)[:, None]
    return np.concatenate([a + shares * (b - a) for a, b in itertools.pairwise(corners)])


def test_it_finds_the_door_in_a_wall():
    corners = plan(wall_with_a_door)
    np.testing.assert_array_equal(corners[[0, -1]], [START, GOAL])
    assert not wall_with_a_door(along(np.array([START, GOAL])), padding=0.0).all()
    assert wall_with_a_door(along(corners), padding=0.0).all()


def test_without_obstacles_the_way_is_straight():
    corners = plan(lambda q: np.ones(len(q), dtype=bool))
    length = np.linalg.norm(np.diff(corners, axis=0), axis=1).sum()
    assert length == pytest.approx(np.linalg.norm(GOAL - START), rel=0.02)


def test_shortening_never_makes_a_way_longer():
    def length(corners):
        return np.linalg.norm(np.diff(corners, axis=0), axis=1).sum()

    assert length(plan(wall_with_a_door)) < length(plan(wall_with_a_door, shortcuts=0))


def test_of_several_goals_one_that_can_be_reached_is_reached():
    sealed = np.full(5, 0.9)
    goals = np.stack((sealed, GOAL))

    def free(q):
        return (np.abs(q - sealed).max(axis=1) > 0.2) | (np.abs(q - sealed).max(axis=1) < 0.05)

    np.testing.assert_array_equal(plan(free, goals)[-1], GOAL)


def test_where_there_is_no_way_it_finds_none():
    assert plan(lambda q: np.abs(q[:, 0]) > 0.1, samples=100) is None


def test_the_same_call_finds_the_same_way():
    np.testing.assert_array_equal(plan(wall_with_a_door), plan(wall_with_a_door))


def test_all_motions_of_a_batch_are_checked_at_once():
    asked = []

    def free(q):
        asked.append(len(q))
        return wall_with_a_door(q)

    assert plan(free, batch=64, shortcuts=0) is not None
    assert max(asked) > 64
    # Two questions for each growth of a tree, however many motions it has.
    alone = []
    assert plan(lambda q: alone.append(1) or wall_with_a_door(q), batch=1, shortcuts=0) is not None
    assert len(asked) < len(alone)
