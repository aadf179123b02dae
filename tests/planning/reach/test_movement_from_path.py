from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.diagrams.factory import make_coupling
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.reach.barrier_for_path import fit_barrier_to_path
from pepper_drake.planning.reach.movement_from_path import (
    fit_primitive_to_joint_path,
    reachable_pre_grasp,
)
from pepper_drake.planning.trajectories.joint_trajectories import time_parameterize

MODEL = shared_control_model()
CORNERS = np.array(
    [[1.5, -0.2, 1.2, 0.5, 0.0], [1.0, -0.9, 0.6, 0.6, -0.4], [0.8, -0.5, 1.1, 1.0, 0.6]]
)
PATH = time_parameterize(CORNERS, 60)
DURATION = 3.0


@pytest.fixture(scope="module")
def kinematics():
    return arm_kinematics(MODEL, "right")


@pytest.fixture(scope="module")
def primitive(kinematics):
    return fit_primitive_to_joint_path(kinematics, PATH, DURATION, "a way")


def test_a_joint_path_becomes_a_primitive_that_performs_it(kinematics, primitive):
    assert DURATION < primitive.duration < 1.1 * DURATION
    assert primitive.posture.names == arm_joints("right")
    path = primitive.rollout(time_step=DURATION / (len(PATH) - 1))
    for k, joints in enumerate(PATH):
        X_TH = kinematics.hand_pose(joints)
        np.testing.assert_allclose(path.positions[k], X_TH.translation(), atol=1e-3)
        np.testing.assert_allclose(path.joints[k], joints, atol=5e-3)
        q = X_TH.rotation().ToQuaternion().wxyz()
        assert abs(q @ path.rotations[k]) > 1 - 1e-5


def test_it_stays_at_its_goal(primitive):
    path = primitive.rollout(settle=1.0)
    after = path.times > primitive.duration
    off = np.linalg.norm(path.positions[after] - primitive.goal, axis=1)
    assert off.max() < 2e-3


def test_it_follows_a_goal_that_has_moved(primitive):
    goal = primitive.goal + [0.03, -0.02, 0.04]
    path = primitive.rollout(goal=goal, settle=0.4)
    np.testing.assert_allclose(path.positions[-1], goal, atol=2e-3)


def test_the_pre_grasp_keeps_its_place_and_takes_the_hands_direction(kinematics):
    X_OG = RigidTransform(RollPitchYaw(1.5, -0.2, 0.1), [-0.015, -0.085, 0.11])
    X_TO = RigidTransform(RollPitchYaw(0.0, 0.0, 0.3), [0.3, -0.1, -0.1])
    X = reachable_pre_grasp(X_OG, X_TO, kinematics, PATH[-1])
    np.testing.assert_array_equal(X.translation(), X_OG.translation())
    R_TH = kinematics.hand_pose(PATH[-1]).rotation().matrix()
    np.testing.assert_allclose((X_TO @ X).rotation().matrix(), R_TH, atol=1e-12)


def beside(path, distance, spacing=0.02):
    """A wall of points beside the middle of a path, at a distance from its nearest sample."""
    middle = path.positions[len(path.positions) // 2]
    y, z = np.meshgrid(np.arange(-0.1, 0.11, spacing), np.arange(-0.1, 0.11, spacing))
    wall = np.column_stack((np.zeros(y.size), y.ravel(), z.ravel()))
    ahead = path.positions[:, 0].max()
    return wall + [ahead + distance, middle[1], middle[2]]


def pushes(coupling, field, path, goal):
    rho = coupling.clearance(field, goal)
    return np.array(
        [
            np.linalg.norm(coupling.push(field, np.stack((y, v)), a, goal, rho, DURATION).coupling)
            for y, v, a in zip(path.positions, path.velocities, path.accelerations, strict=True)
        ]
    )


@pytest.mark.parametrize("distance", [0.03, 0.06, 0.09])
def test_along_the_plan_the_barrier_is_silent(primitive, distance):
    path = primitive.rollout(time_step=0.02)
    field = PointCloudDistance(beside(path, distance))
    usual = make_coupling("barrier")
    quiet = fit_barrier_to_path(usual, field, path.positions, path.velocities, path.accelerations)
    assert pushes(usual, field, path, path.positions[-1]).max() > 0.0
    assert pushes(quiet, field, path, path.positions[-1]).max() == 0.0
    assert replace(quiet, hand_radius=usual.hand_radius) == usual


def test_what_is_nearer_than_the_plan_knew_is_pushed_against(primitive):
    path = primitive.rollout(time_step=0.02)
    quiet = fit_barrier_to_path(
        make_coupling("barrier"),
        PointCloudDistance(beside(path, 0.06)),
        path.positions,
        path.velocities,
        path.accelerations,
    )
    nearer = PointCloudDistance(beside(path, 0.02))
    assert pushes(quiet, nearer, path, path.positions[-1]).max() > 0.0


@pytest.mark.parametrize("points", [np.zeros((0, 3)), np.array([[3.0, 0.0, 0.0]])])
def test_far_from_everything_the_barrier_stays_as_it_is(primitive, points):
    path = primitive.rollout(time_step=0.02)
    usual = make_coupling("barrier")
    field = PointCloudDistance(points)
    same = fit_barrier_to_path(usual, field, path.positions, path.velocities, path.accelerations)
    assert same == usual
