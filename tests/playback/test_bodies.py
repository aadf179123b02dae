from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.models.pepper import MODELS_DIR, PEPPER_URDF
from pepper_drake.playback.bodies import RecordedModel, replay_frames
from pepper_drake.playback.loading import load_motion
from tests.playback.run_example import BASE_POSE, GOAL_RISE

REACH = MODELS_DIR / "demonstrations" / "reach"


@pytest.fixture(scope="module")
def high(runs):
    return replay_frames(load_motion(runs[1]))


def named(frames, name):
    (body,) = [body for body in frames.bodies if body.name == name]
    return body


def test_there_are_thirty_frames_a_second_up_to_the_end(high):
    np.testing.assert_allclose(np.diff(high.times), 1 / 30)
    assert high.times[-1] >= 2.5
    assert high.clock[-1] == pytest.approx(2.5), "nothing after the last sample"


def test_every_link_is_where_drake_has_it(runs, high):
    """Against a plant that was put together by other means, from the model file alone."""
    plant = MultibodyPlant(0.0)
    parser = Parser(plant)
    parser.package_map().AddPackageXml(MODELS_DIR / "package.xml")
    parser.AddModels(PEPPER_URDF)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("odom"))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    motion = load_motion(runs[1])
    frame = 47
    q = plant.GetPositions(context)
    for name, values in motion.positions.items():
        if plant.HasJointNamed(name):
            value = np.interp(high.clock[frame], motion.times, values)
            q[plant.GetJointByName(name).position_start()] = value
    plant.SetPositions(context, q)
    links = [body for body in high.bodies if body.is_robot]
    assert len(links) > 10
    for link in links:
        X_WB = plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(link.name))
        np.testing.assert_allclose(link.translations[frame], X_WB.translation(), atol=1e-9)
        turn = X_WB.rotation().ToQuaternion().wxyz()
        assert abs(turn @ link.quaternions[frame]) == pytest.approx(1.0, abs=1e-12)


def test_pepper_stands_where_its_base_was(high):
    x, y, yaw = BASE_POSE
    torso, base = named(high, "torso"), named(high, "Tibia")
    np.testing.assert_allclose(base.translations[:, :2], [[x, y]] * len(high.times), atol=1e-9)
    np.testing.assert_allclose(torso.translations[:, 2], 0.82, atol=2e-3)
    assert high.yaw == pytest.approx(yaw, abs=1e-3)
    turn = RotationMatrix(RollPitchYaw(0.0, 0.0, yaw)).ToQuaternion().wxyz()
    np.testing.assert_allclose(base.quaternions[0], turn, atol=1e-9)


def test_the_goal_object_rises_as_it_did(high):
    goal = named(high, "goal_object")
    assert not goal.is_robot
    assert goal.translations[0, 2] == pytest.approx(0.78)
    rise = goal.translations[:, 2] - goal.translations[0, 2]
    np.testing.assert_allclose(rise, GOAL_RISE * np.clip(high.clock - 1.0, 0.0, 1.0), atol=1e-9)


def test_only_shapes_made_for_people_are_shown(high):
    names = [part.name for part in named(high, "Tibia").parts]
    assert any("belt" in name for name in names)
    assert not any("seen" in name for name in names)
    assert len(named(high, "goal_object").parts) == 3, "cylinder, plate and marker"


def test_the_way_of_the_hand_begins_with_the_arm(runs, high):
    whole, arm_only = high, replay_frames(load_motion(runs[1]), from_arm=True)
    assert arm_only.clock[0] == pytest.approx(1.0)
    assert len(arm_only.times) < len(whole.times)
    np.testing.assert_allclose(arm_only.hand_W, whole.hand_W, atol=1e-12)
    rise = whole.hand_W[-1, 2] - whole.hand_W[0, 2]
    assert rise > 0.1, "the shoulder lifts the hand"
    np.testing.assert_allclose(whole.shown_W[0], whole.hand_W[0], atol=1e-12)


def test_the_cloud_is_put_where_the_torso_was_when_it_was_seen(high):
    x, y, yaw = BASE_POSE
    X_WT = RigidTransform(RollPitchYaw(0.0, 0.0, yaw), [x, y, 0.82])
    expected = [X_WT @ point for point in high.motion.cloud_T]
    np.testing.assert_allclose(high.cloud_W, expected, atol=0.03)


def test_a_demonstrations_joints_lead_the_hand_along_its_recorded_way():
    demo = Demonstration.load(REACH)
    motion = load_motion(REACH)
    model = RecordedModel(motion)
    (X_WT,) = model.frame_poses("torso", demo.times[:1])
    hand_T = [
        X_WT.inverse() @ X_WH.translation()
        for X_WH in model.frame_poses("r_hand_effector", demo.times)
    ]
    np.testing.assert_allclose(hand_T, demo.positions, atol=1e-3)


def test_a_hand_without_an_arm_is_a_ball_with_axes_on_the_recorded_way():
    demo = Demonstration.load(REACH)
    motion = load_motion(REACH)
    bare = replace(motion, positions={}, hand_T=demo.positions, hand_rotations_T=demo.rotations)
    frames = replay_frames(bare)
    hand = named(frames, "hand")
    assert [part.name for part in hand.parts] == ["hand", "x_axis", "y_axis", "z_axis"]
    with_arm = replay_frames(motion)
    np.testing.assert_allclose(hand.translations[-1], with_arm.hand_W[-1], atol=2e-3)
    (X_WH,) = RecordedModel(motion).frame_poses("r_hand_effector", demo.times[-1:])
    turn = X_WH.rotation().ToQuaternion().wxyz()
    assert abs(turn @ hand.quaternions[-1]) == pytest.approx(1.0, abs=1e-3)


def test_an_unknown_joint_is_named(runs):
    motion = load_motion(runs[0])
    strange = replace(motion, positions={"ThirdElbow": np.zeros(len(motion.times))})
    with pytest.raises(InputError, match='no joint "ThirdElbow"'):
        replay_frames(strange)
