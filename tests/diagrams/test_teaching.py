import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.teaching import Teaching
from pepper_drake.models.pepper import BODY_JOINTS, JOINT_GROUPS, posture_positions


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


def test_dragged_joints_follow_and_all_else_holds():
    start = posture_positions("stand")
    teaching = Teaching("left", start, guided_by="joints")
    simulator = Simulator(teaching)
    context = simulator.get_mutable_context()
    target = [1.2, 0.5, -1.0, -0.9, 0.3]
    teaching.GetInputPort("joint_target").FixValue(context, target)
    simulator.AdvanceTo(1.5)
    positions = teaching.GetOutputPort("joint_position").Eval(context)
    expected = start | dict(zip(JOINT_GROUPS["left_arm"], target, strict=True))
    np.testing.assert_allclose(positions, [expected[name] for name in BODY_JOINTS], atol=2e-3)


def test_a_limit_of_a_joint_stops_the_drag():
    teaching = Teaching("right", posture_positions("stand"), guided_by="joints")
    simulator = Simulator(teaching)
    context = simulator.get_mutable_context()
    target = [1.2, -0.5, 1.2, -0.5, 0.0]
    teaching.GetInputPort("joint_target").FixValue(context, target)
    simulator.AdvanceTo(1.0)
    elbow = BODY_JOINTS.index("RElbowRoll")
    angle = teaching.GetOutputPort("joint_position").Eval(context)[elbow]
    assert angle == pytest.approx(0.0087, abs=0.01)
