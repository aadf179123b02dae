"""A recorded movement in qiBullet's model of Pepper, where qiBullet is installed."""

import importlib.util
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pepper_drake.models.control_model import BODY_JOINTS, shared_control_model
from pepper_drake.models.pepper import set_joint_positions
from pepper_drake.naoqi.constants import HANDS


def test_joints_by_their_names_lead_the_hand_along_the_same_path():
    found = importlib.util.find_spec("qibullet")
    if found is None or found.origin is None:
        pytest.skip("qiBullet is not installed")
    robot = ET.parse(Path(found.origin).parent / "robot_data" / "pepper.urdf").getroot()
    assert {*BODY_JOINTS, *HANDS} <= {joint.get("name") for joint in robot.iter("joint")}
    for transmission in robot.findall("transmission"):
        robot.remove(transmission)
    for link in robot.iter("link"):  # Its meshes need a consent to their licence.
        for shape in (*link.findall("visual"), *link.findall("collision")):
            link.remove(shape)
    theirs = MultibodyPlant(0.0)
    Parser(theirs).AddModelsFromString(ET.tostring(robot, encoding="unicode"), "urdf")
    theirs.Finalize()
    ours = shared_control_model()
    limits, rng, offsets = ours.command_limits(BODY_JOINTS), np.random.default_rng(0), []
    for _ in range(20):
        values = rng.uniform(limits.position_lower, limits.position_upper)
        q = dict(zip(BODY_JOINTS, values, strict=True))
        contexts = theirs.CreateDefaultContext(), ours.create_context()
        for name, value in q.items():
            theirs.GetJointByName(name).set_angle(contexts[0], value)
        set_joint_positions(ours.plant, contexts[1], ours.model_instance, q)
        X_SH = []  # From the shoulder: the origins of the torsos differ, too.
        for plant, hand, context in zip(
            (theirs, ours.plant), ("r_gripper", "r_hand_effector"), contexts, strict=True
        ):
            shoulder = plant.GetJointByName("RShoulderPitch").frame_on_parent()
            X_SH.append(plant.GetFrameByName(hand).CalcPose(context, shoulder))
        offsets.append((X_SH[0].inverse() @ X_SH[1]).GetAsMatrix4())
    assert np.ptp(offsets, axis=0).max() < 1e-3  # A constant offset between the hands' frames.
