import re

import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.demonstrations.conditioning import BOUND_SHARE
from pepper_drake.learning.dmp.joint_primitive import (
    FIT_TOLERANCE,
    JointPrimitive,
    is_joint_primitive,
)
from tests.learning.demonstrations.importers.recordings import NAMES, make_motion, turn

MOTION = make_motion()
T, J = MOTION.times, MOTION.joints


@pytest.mark.parametrize("count", [1, 2, 5])
def test_any_number_of_joints_comes_back_as_shown(count):
    primitive = JointPrimitive.fit(T, J[:, :count], NAMES[:count])
    path = primitive.rollout(time_step=T[1])
    np.testing.assert_allclose(path.joints, J[:, :count], atol=1e-4)
    np.testing.assert_allclose(path.joints[-1], primitive.goal, atol=1e-4)


def test_more_joints_than_an_arm_has(tmp_path):
    names = [f"joint{k}" for k in range(12)]
    joints = np.column_stack([np.sin(0.3 * k + T) for k in range(12)])
    primitive = JointPrimitive.fit(T, joints, names)
    path = primitive.rollout(goal=primitive.goal + 0.1, duration=3.0)
    assert path.times[-1] == pytest.approx(3.0)
    np.testing.assert_allclose(path.joints[-1], primitive.goal + 0.1, atol=2e-3)


def test_a_saved_primitive_rolls_out_bit_for_bit(tmp_path):
    primitive = JointPrimitive.of(MOTION)
    path = tmp_path / "joints.yaml"
    primitive.save(path)
    assert is_joint_primitive(path)
    back = JointPrimitive.load(path)
    assert back.names == NAMES
    np.testing.assert_array_equal(back.rollout().joints, primitive.rollout().joints)
    with pytest.raises(InputError, match="a primitive of joints"):
        MovementPrimitive.load(path)


def test_the_hand_follows_by_forward_kinematics():
    hand = JointPrimitive.of(MOTION).hand_demonstration(time_step=T[1])
    np.testing.assert_allclose(hand.positions, MOTION.positions, atol=1e-4)
    assert turn(hand.rotations, MOTION.rotations).max() < 1e-3
    some = JointPrimitive.fit(T, J[:, [0, 3]], (NAMES[0], NAMES[3]))
    held = some.hand_demonstration({NAMES[1]: -0.2, NAMES[2]: 1.0, NAMES[4]: 0.0})
    np.testing.assert_allclose(held.joints[:, 2], 1.0)
    with pytest.raises(InputError, match="where is RShoulderRoll while the others move"):
        some.hand_demonstration()
    with pytest.raises(InputError, match="not joints of one arm"):
        JointPrimitive.fit(T, J[:, :1], ("HeadYaw",)).hand_demonstration()


def test_few_key_postures_are_not_overshot():
    keys = np.array([[0.0], [1.0], [1.0], [0.2], [0.2]])
    path = JointPrimitive.fit([0.0, 1.0, 1.5, 3.0, 4.0], keys, ("RElbowYaw",)).rollout()
    assert path.joints.min() > -0.02
    assert path.joints.max() < 1.02


@pytest.mark.parametrize("count", [8, 20, 30])
def test_a_few_postures_are_followed_as_near_as_a_hand_would(count):
    """Between two postures the bound of the hand's primitives: a quarter of their distance."""
    joints = np.cumsum(np.random.default_rng(2).normal(0.0, 0.2, (count, 3)), axis=0)
    times = np.linspace(0.0, 4.0, count)
    path = JointPrimitive.fit(times, joints, NAMES[:3]).rollout()
    lines = np.column_stack([np.interp(path.times, times, column) for column in joints.T])
    largest = np.abs(np.diff(joints, axis=0)).max()
    assert np.abs(path.joints - lines).max() < BOUND_SHARE * largest + 2.0 * FIT_TOLERANCE


def test_a_long_recording_gets_as_many_basis_functions_as_it_needs():
    times = np.linspace(0.0, 60.0, 3001)
    joints = 0.4 * np.sin(2.0 * np.pi * times)[:, None]
    path = JointPrimitive.fit(times, joints, NAMES[:1]).rollout(time_step=0.02)
    assert np.abs(path.joints - joints).max() < FIT_TOLERANCE


@pytest.mark.parametrize(
    ("times", "joints", "names", "words"),
    [
        (T, J[:-1], NAMES, r"must be \(N,\) and \(N, J\)"),
        (T, J, NAMES[:3], "3 given"),
        (T[:3], J[:3], NAMES, "N >= 4"),
        (T, np.where(J > 0, np.nan, J), NAMES, "not finite"),
        (T[::-1], J, NAMES, "times must increase"),
        ("abc", J, NAMES, "not arrays of numbers"),
    ],
)
def test_refuses_what_is_no_motion(times, joints, names, words):
    with pytest.raises(InputError, match=words):
        JointPrimitive.fit(times, joints, names)


def test_refuses_a_broken_file(tmp_path):
    path = tmp_path / "joints.yaml"
    JointPrimitive.of(MOTION).save(path)
    text = path.read_text()
    for old, new, words in (
        ("RElbowYaw, ", "", "4 joints|must be 4 finite"),
        ("duration:", "during:", "duration is missing"),
        ("version: 1", "version: 9", "version 9"),
        ("start:", "begin:", "start is missing"),
    ):
        path.write_text(text.replace(old, new, 1))
        with pytest.raises(InputError, match=words):
            JointPrimitive.load(path)


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("alpha_x", ".inf", "alpha_x is inf"),
        ("widths", "[1e-60", "widths"),
        ("centres", "[1e9", "centres"),
    ],
)
def test_refuses_basis_functions_of_no_phase(tmp_path, field, value, words):
    times = np.linspace(0.0, 1.0, 20)
    path = tmp_path / "joints.yaml"
    JointPrimitive.fit(times, np.sin(times)[:, None], ["RElbowYaw"], num_basis=6).save(path)
    text = re.sub(rf"({field}: )(\[[^,]+|\S+)", rf"\g<1>{value}", path.read_text())
    path.write_text(text)
    with pytest.raises(InputError, match=words):
        JointPrimitive.load(path)
