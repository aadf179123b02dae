import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.tree import JacobianWrtVariable

from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.pepper import ARMS, hand_frame
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics
from pepper_drake.planning.collision.sphere_model import arm_link_names

MODEL = shared_control_model()


@pytest.fixture(params=ARMS)
def arm(request):
    return request.param


@pytest.fixture
def joints(arm):
    limits = MODEL.command_limits(arm_joints(arm))
    rng = np.random.default_rng(3)
    return rng.uniform(limits.position_lower, limits.position_upper, (25, 5))


def drake_context(arm, q):
    """A context whose other joints are anywhere: the arm hangs on the torso."""
    context = MODEL.create_context()
    positions = np.random.default_rng(4).uniform(-0.4, 0.4, MODEL.plant.num_positions())
    positions[MODEL.position_indices(arm_joints(arm))] = q
    MODEL.plant.SetPositions(context, positions)
    return context


def test_the_hands_pose_is_drakes(arm, joints):
    poses = ArmKinematics(MODEL, arm).poses(joints)
    for k, q in enumerate(joints):
        X_TH = MODEL.pose(drake_context(arm, q), hand_frame(arm), "torso")
        np.testing.assert_allclose(poses.hand_position[k], X_TH.translation(), atol=1e-12)
        np.testing.assert_allclose(poses.hand_rotation[k], X_TH.rotation().matrix(), atol=1e-12)


def test_the_links_poses_are_drakes(arm, joints):
    poses = ArmKinematics(MODEL, arm).poses(joints)
    for link, name in enumerate(arm_link_names(arm)):
        for k, q in enumerate(joints[:8]):
            X_TL = MODEL.pose(drake_context(arm, q), name, "torso")
            np.testing.assert_allclose(poses.positions[k, link], X_TL.translation(), atol=1e-12)
            np.testing.assert_allclose(
                poses.rotations[k, link], X_TL.rotation().matrix(), atol=1e-12
            )


def test_the_hands_jacobian_is_drakes(arm, joints):
    J = ArmKinematics(MODEL, arm).poses(joints).hand_jacobian()
    plant = MODEL.plant
    hand, torso = plant.GetFrameByName(hand_frame(arm)), plant.GetFrameByName("torso")
    columns = MODEL.position_indices(arm_joints(arm))
    for k, q in enumerate(joints):
        expected = plant.CalcJacobianSpatialVelocity(
            drake_context(arm, q), JacobianWrtVariable.kQDot, hand, np.zeros(3), torso, torso
        )[:, columns]
        np.testing.assert_allclose(J[k], expected, atol=1e-12)


def test_spheres_are_where_their_links_put_them(arm, joints):
    kinematics = ArmKinematics(MODEL, arm)
    poses = kinematics.poses(joints)
    centers = kinematics.sphere_centers(poses)
    R, p = poses.rotations[:, :-1], poses.positions[:, :-1]
    np.testing.assert_allclose(centers, kinematics.spheres.place(R, p), atol=1e-12)
    some = kinematics.spheres.link == 3
    hand = kinematics.sphere_centers(poses, kinematics.spheres.selected(some))
    np.testing.assert_array_equal(hand, centers[:, some])


def test_poses_in_another_frame_are_those_of_the_torso_moved(arm, joints):
    kinematics = ArmKinematics(MODEL, arm)
    X_FT = RigidTransform(RollPitchYaw(0.1, -0.2, 0.8), [0.4, -0.3, 0.8])
    in_T, in_F = kinematics.poses(joints), kinematics.poses(joints, X_FT)
    R_FT = X_FT.rotation().matrix()
    np.testing.assert_allclose(in_F.rotations, R_FT @ in_T.rotations, atol=1e-12)
    moved = in_T.positions @ R_FT.T + X_FT.translation()
    np.testing.assert_allclose(in_F.positions, moved, atol=1e-12)
