import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.collision.exact_distance import ExactDistance
from pepper_drake.planning.collision.path_distances import arm_motion, path_distances

MODEL = shared_control_model()
KINEMATICS = arm_kinematics(MODEL, "right")
SHAPES = ExactDistance(MODEL, KINEMATICS)
ENDS = np.array([[1.4, -0.2, 1.2, 0.5, 0.0], [0.2, -0.5, 0.9, 1.2, 0.8]])


def fast_path(count=40):
    """The hand moves by 8 mm from one posture to the next."""
    return ENDS[0] + np.linspace(0.0, 1.0, count)[:, None] * (ENDS[1] - ENDS[0])


@given(seed=st.integers(0, 1000), count=st.integers(2, 30))
def test_the_least_distance_is_that_of_all_postures(seed, count):
    rng = np.random.default_rng(seed)
    points, places = rng.uniform(-1.0, 1.0, (3, 2)), rng.uniform(-0.1, 0.1, (count, 2)).cumsum(0)
    motion = np.linalg.norm(np.diff(places, axis=0), axis=1)

    def distances(places):
        return np.linalg.norm(places[:, None] - points, axis=2).min(axis=1)

    every = distances(places)
    found = path_distances(distances, places, motion)
    assert found.minimum == every.min()
    np.testing.assert_array_equal(found.distances, every[found.indices])
    assert np.all(np.diff(found.indices) > 0)
    assert {0, count - 1} <= set(found.indices.tolist())


@pytest.mark.parametrize("nearest", [9, 18, 27])
def test_an_obstacle_that_is_near_for_a_moment_only_is_found(nearest):
    path = fast_path()
    hand = KINEMATICS.poses(path).hand_position
    # A point beside the hand, on the far side of its path's bend.
    field = PointCloudDistance(hand[nearest : nearest + 1] + [0.0, 0.05, 0.0], extension=0.0)

    def distances(q):
        return SHAPES.distances(q, field, RigidTransform(), within=0.15)

    found = path_distances(distances, path, arm_motion(KINEMATICS, KINEMATICS.poses(path)))
    assert found.minimum == distances(path).min()
    assert len(found.indices) < 0.6 * len(path)


def test_no_distance_changes_by_more_than_the_arm_moves():
    path = fast_path()
    rng = np.random.default_rng(0)
    motion = arm_motion(KINEMATICS, KINEMATICS.poses(path))
    for point in rng.uniform([0.0, -0.5, -0.3], [0.4, 0.0, 0.2], (20, 3)):
        field = PointCloudDistance(point[None], extension=0.0)
        # Near 0.15 m there are the spheres' distances, and nearer those of the shapes.
        distances = SHAPES.distances(path, field, RigidTransform(), within=0.15)
        near = np.flatnonzero((distances[1:] < 0.02) & (distances[:-1] < 0.02))
        assert np.all(np.abs(distances[near + 1] - distances[near]) <= motion[near] + 1e-9)


def test_where_all_is_farther_than_it_matters_only_few_are_measured():
    path = np.linspace(0.0, 1.0, 41)[:, None]
    motion = np.full(40, 0.025)
    found = path_distances(lambda x: 0.5 + np.abs(x[:, 0] - 0.52), path, motion, below=0.1)
    assert found.indices.tolist() == list(range(0, 41, 4))
