import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.teaching import Teaching, record_guided
from pepper_drake.models.guide import load_guide
from pepper_drake.models.pepper import (
    JOINT_GROUPS,
    add_pepper,
    posture_positions,
    set_joint_positions,
)


@pytest.fixture(scope="module")
def recording():
    script = load_guide("reach")
    script.via_points = script.via_points[:3]
    script.rest = 0.4
    return script, record_guided(script)


def hand_poses(demo):
    plant = MultibodyPlant(0.0)
    model = add_pepper(plant)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    torso, hand = plant.GetFrameByName("torso"), plant.GetFrameByName("r_hand_effector")
    for q in demo.joints:
        set_joint_positions(plant, context, model, dict(zip(demo.joint_names, q, strict=True)))
        yield hand.CalcPose(context, torso)


def test_record_agrees_with_the_joints_it_was_made_of(recording):
    _, result = recording
    demo = result.demonstration
    for X_TH, p, q in zip(hand_poses(demo), demo.positions, demo.rotations, strict=True):
        # 1 mm and 1 degree.
        np.testing.assert_allclose(p, X_TH.translation(), atol=1e-3)
        assert abs(X_TH.rotation().ToQuaternion().wxyz() @ q) > np.cos(np.radians(0.5))


def test_the_hand_follows_the_guide_to_where_it_rests(recording):
    script, result = recording
    assert result.final_distance < 3e-3
    np.testing.assert_allclose(
        result.demonstration.positions[-1], script.via_points[-1].position, atol=4e-3
    )
    assert np.linalg.norm(result.demonstration.velocities[[0, -1]], axis=1).max() < 0.01
    assert result.demonstration.times[0] == 0.0


def test_the_arm_is_limp_and_all_else_holds():
    start = posture_positions("stand")
    teaching = Teaching("right", start)
    simulator = Simulator(teaching)
    context = simulator.get_mutable_context()
    plant = teaching.plant
    plant_context = plant.GetMyContextFromRoot(context)
    X_WH = plant.GetFrameByName("r_hand_effector").CalcPoseInWorld(plant_context)
    # The guide is 15 cm to the right of the hand and 10 cm above it.
    X_WG = RigidTransform(X_WH.rotation(), X_WH.translation() + np.array([0.0, -0.15, 0.1]))
    teaching.GetInputPort("guide_pose").FixValue(context, X_WG)
    simulator.AdvanceTo(1.5)
    positions = plant.GetPositions(plant_context)
    for name in set(start) - set(JOINT_GROUPS["right_arm"]):
        angle = positions[plant.GetJointByName(name).position_start()]
        assert angle == pytest.approx(start[name], abs=2e-3), name
    X_WH = plant.GetFrameByName("r_hand_effector").CalcPoseInWorld(plant_context)
    assert np.linalg.norm(X_WH.translation() - X_WG.translation()) < 0.02
    X_TH = teaching.GetOutputPort("hand_pose").Eval(context)
    X_WT = plant.GetFrameByName("torso").CalcPoseInWorld(plant_context)
    assert (X_WT @ X_TH).IsNearlyEqualTo(X_WH, 1e-9)
