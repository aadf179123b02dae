import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.learning.demonstrations.arm_chain import arm_chain, arm_of, joint_limits
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics


@pytest.mark.parametrize("arm", ["left", "right"])
def test_forward_kinematics_are_those_of_drake(arm):
    chain = arm_chain(arm)
    joints = np.random.default_rng(0).uniform(chain.lower, chain.upper, (200, 5))
    positions, rotations = chain.hand(joints)
    poses = arm_kinematics(shared_control_model(), arm).poses(joints)
    np.testing.assert_allclose(positions, poses.hand_position, atol=1e-12)
    turned = np.stack([_matrix(q) for q in rotations])
    np.testing.assert_allclose(turned, poses.hand_rotation, atol=1e-12)


def _matrix(q):
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


@pytest.mark.parametrize("arm", ["left", "right"])
def test_no_posture_has_the_hand_farther_than_the_arm_is_long(arm):
    chain = arm_chain(arm)
    joints = np.random.default_rng(1).uniform(chain.lower, chain.upper, (20_000, 5))
    away = np.linalg.norm(chain.hand(joints)[0] - chain.shoulder, axis=1)
    assert 0.9 * chain.length < away.max() <= chain.length


@settings(max_examples=20)
@given(st.integers(0, 10_000))
def test_poses_of_the_arm_are_told_from_their_quaternions_in_another_order(seed):
    # Of one pose the other order may be another posture's orientation, so the median counts.
    chain = arm_chain("right")
    joints = np.random.default_rng(seed).uniform(chain.lower, chain.upper, (20, 5))
    positions, rotations = chain.hand(joints)
    assert chain.pose_distances(positions, rotations).max() < 2e-3
    assert np.median(chain.pose_distances(positions, rotations[:, [3, 0, 1, 2]])) > 0.05


def test_limits_and_names_are_the_robots():
    assert joint_limits()["RShoulderRoll"] == (-1.56207, -0.00872665)
    assert arm_of(arm_chain("left").joint_names) == "left"
    assert arm_of(("RElbowYaw",)) is None
