import numpy as np
import pytest

from pepper_drake.models.control_model import (
    BODY_JOINTS,
    ControlModel,
    arm_joints,
    body_indices,
    shared_control_model,
)
from pepper_drake.models.pepper import JOINT_GROUPS

MODEL = shared_control_model()


def test_the_body_is_every_joint_but_the_base():
    plant = MODEL.plant
    names = {plant.get_joint_actuator(i).joint().name() for i in plant.GetJointActuatorIndices()}
    assert names == {*BODY_JOINTS, *JOINT_GROUPS["base"]}
    assert len(BODY_JOINTS) == len(set(BODY_JOINTS)) == 15


@pytest.mark.parametrize("arm", ["left", "right"])
def test_an_arm_is_five_joints_from_shoulder_to_wrist(arm):
    side = arm[0].upper()
    assert arm_joints(arm) == tuple(
        side + name
        for name in ("ShoulderPitch", "ShoulderRoll", "ElbowYaw", "ElbowRoll", "WristYaw")
    )
    assert [BODY_JOINTS[k] for k in body_indices(arm_joints(arm))] == list(arm_joints(arm))


def test_positions_are_the_plants_own_by_name():
    joints, base = np.linspace(-0.3, 0.3, 15), np.array([1.0, 2.0, 3.0])
    context = MODEL.create_context()
    MODEL.plant.SetPositions(context, MODEL.positions(joints, base))
    for name, value in zip((*BODY_JOINTS, *JOINT_GROUPS["base"]), (*joints, *base), strict=True):
        joint = MODEL.plant.GetJointByName(name)
        assert joint.GetOnePosition(context) == value


def test_a_turned_base_turns_the_torso_with_it():
    context = MODEL.create_context()
    MODEL.plant.SetPositions(
        context, MODEL.positions(np.zeros(15), np.array([0.5, 0.2, np.pi / 2]))
    )
    X_WT = MODEL.pose(context, "torso")
    # The torso is ahead of the base's centre or behind it, so a quarter turn carries it sideways.
    MODEL.plant.SetPositions(context, MODEL.positions(np.zeros(15), np.zeros(3)))
    ahead, left, up = MODEL.pose(context, "torso").translation()
    np.testing.assert_allclose(X_WT.translation(), [0.5 - left, 0.2 + ahead, up], atol=1e-12)
    np.testing.assert_allclose(X_WT.rotation().matrix()[:, 0], [0, 1, 0], atol=1e-12)


def test_a_pose_relative_to_another_frame_is_the_two_poses_in_world_divided():
    context = MODEL.create_context()
    MODEL.plant.SetPositions(context, MODEL.positions(np.full(15, 0.2), np.array([0.5, 0.2, 1.0])))
    X_WT, X_WH = MODEL.pose(context, "torso"), MODEL.pose(context, "l_hand_effector")
    X_TH = MODEL.pose(context, "l_hand_effector", "torso")
    assert (X_WT @ X_TH).IsNearlyEqualTo(X_WH, 1e-12)


def test_limits_are_the_rated_ones_with_the_speed_scaled():
    limits = MODEL.command_limits(("RShoulderRoll", "HeadYaw"), speed_fraction=0.5)
    # NAOqi's figures: -89.5 to -0.5 degrees and +-119.5 degrees.
    np.testing.assert_allclose(np.degrees(limits.position_lower), [-89.5, -119.5], atol=0.01)
    np.testing.assert_allclose(np.degrees(limits.position_upper), [-0.5, 119.5], atol=0.01)
    full = MODEL.command_limits(("RShoulderRoll", "HeadYaw"))
    np.testing.assert_allclose(limits.velocity, 0.5 * full.velocity)
    assert np.all(full.velocity > 1.0)


def test_there_is_one_shared_model_and_its_contexts_are_apart():
    assert shared_control_model() is MODEL
    assert ControlModel() is not MODEL
    one, other = MODEL.create_context(), MODEL.create_context()
    before = MODEL.plant.GetPositions(other).copy()
    MODEL.plant.SetPositions(one, np.full(18, 0.1))
    np.testing.assert_array_equal(MODEL.plant.GetPositions(other), before)
    np.testing.assert_array_equal(MODEL.plant.GetPositions(MODEL.create_context()), before)
