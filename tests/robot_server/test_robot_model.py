import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pepper_drake.naoqi.constants import BODY, CHAINS, JOINTS
from pepper_drake.robot_server.robot.robot_model import (
    JOINT_LIMITS,
    LOWER,
    SENSOR_NAMES,
    UPPER,
    UnknownFrameError,
    as_position6,
    clip_to_limits,
    kinematics,
)

# The maker's tables, in degrees.
_RANGES = {
    "HeadYaw": (-119.5, 119.5),
    "HeadPitch": (-40.5, 25.5),
    "LShoulderPitch": (-119.5, 119.5),
    "LShoulderRoll": (0.5, 89.5),
    "LElbowYaw": (-119.5, 119.5),
    "LElbowRoll": (-89.5, -0.5),
    "LWristYaw": (-104.5, 104.5),
    "HipRoll": (-29.5, 29.5),
    "HipPitch": (-59.5, 59.5),
    "KneePitch": (-29.5, 29.5),
    "RShoulderRoll": (-89.5, -0.5),
    "RElbowRoll": (0.5, 89.5),
}


@pytest.mark.parametrize("joint", list(_RANGES))
def test_ranges_are_the_makers(joint):
    limits = JOINT_LIMITS[joint]
    assert np.degrees([limits.lower, limits.upper]) == pytest.approx(_RANGES[joint], abs=0.01)


def test_every_joint_has_limits_and_no_joint_two_chains():
    assert set(JOINT_LIMITS) == set(BODY)
    chained = [joint for joints in CHAINS.values() for joint in joints]
    assert len(set(chained)) == len(chained)


_POSITIONS = st.lists(st.floats(-4, 4), min_size=17, max_size=17).map(np.array)


@given(_POSITIONS)
def test_clipping_once_is_enough_and_moves_nothing_that_is_inside(positions):
    clipped = clip_to_limits(positions)
    assert ((clipped >= LOWER) & (clipped <= UPPER)).all()
    np.testing.assert_array_equal(clip_to_limits(clipped), clipped)


@pytest.mark.parametrize(
    ("yaw", "pitch", "clipped"), [(0.0, 25.5, 25.5), (119.5, 25.5, 13.5), (61.6, -40.0, -35.2)]
)
def test_head_pitch_follows_the_makers_table(yaw, pitch, clipped):
    positions = np.zeros(17)
    positions[:2] = np.radians([yaw, pitch])
    assert np.degrees(clip_to_limits(positions)[1]) == pytest.approx(clipped, abs=1e-2)


def _hand_in_torso(side: int, q: np.ndarray) -> tuple[np.ndarray, Rotation]:
    """Returns the hand's place and orientation by the maker's link lengths; side: left is 1."""
    shoulder = np.array([-0.057, side * 0.14974, 0.08682])
    elbow = np.array([0.1812, side * 0.015, 0.00013])
    turn = Rotation.from_euler("y", q[0]) * Rotation.from_euler("z", q[1])
    place = shoulder + turn.apply(elbow)
    turn *= Rotation.from_euler("y", -0.157079) * Rotation.from_euler("x", q[2])
    turn *= Rotation.from_euler("z", q[3])
    place = place + turn.apply([0.15, 0.0, 0.0])
    turn *= Rotation.from_euler("x", q[4])
    return place + turn.apply([0.0695, 0.0, -0.0303]), turn


@given(_POSITIONS, st.sampled_from([("LArm", 1), ("RArm", -1)]))
@settings(max_examples=30, deadline=None)
def test_hands_are_where_the_makers_lengths_put_them(positions, arm):
    chain, side = arm
    q = positions[[JOINTS.index(name) for name in CHAINS[chain][:5]]]
    place, turn = _hand_in_torso(side, q)
    X = kinematics().transform(chain, 0, positions, (0.3, -0.2, 0.5))
    np.testing.assert_allclose(X.translation(), place, atol=2e-6)
    np.testing.assert_allclose(X.rotation().matrix(), turn.as_matrix(), atol=1e-5)
    x, y, z, wx, wy, wz = as_position6(X)
    rebuilt = Rotation.from_euler("ZYX", [wz, wy, wx])
    np.testing.assert_allclose(rebuilt.as_matrix(), turn.as_matrix(), atol=1e-5)
    assert (x, y, z) == pytest.approx(tuple(X.translation()))


def test_world_and_robot_differ_by_odometry():
    positions = np.zeros(17)
    pose = (1.0, -0.5, 0.7)
    in_robot = kinematics().transform("CameraTop", 2, positions, pose)
    in_world = kinematics().transform("CameraTop", 1, positions, pose)
    turn = Rotation.from_euler("z", 0.7)
    np.testing.assert_allclose(
        in_world.translation(),
        turn.apply(np.array(in_robot.translation())) + [1.0, -0.5, 0.0],
        atol=1e-9,
    )


def test_every_name_that_is_told_has_a_place():
    for name in (*SENSOR_NAMES, *CHAINS, *JOINTS, "Torso"):
        assert np.isfinite(
            as_position6(kinematics().transform(name, 2, np.zeros(17), (0, 0, 0)))
        ).all()
    with pytest.raises(UnknownFrameError):
        kinematics().transform("Tail", 2, np.zeros(17), (0, 0, 0))
