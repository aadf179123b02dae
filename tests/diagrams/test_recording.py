import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.diagrams.recording import (
    RecordOptions,
    Session,
    joint_path,
    record_guided,
    record_joints,
    record_pad,
)
from pepper_drake.diagrams.teaching import Teaching
from pepper_drake.errors import StoppedError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.demonstrations.recording import PARTIAL
from pepper_drake.models.guide import load_guide
from pepper_drake.models.joint_script import load_joint_script
from pepper_drake.models.pad_script import load_pad_script
from pepper_drake.models.pepper import add_pepper, posture_positions, set_joint_positions
from pepper_drake.systems.guiding.scripted_guide import GuidePath, ScriptedGuide


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    script = load_guide("reach")
    script.via_points = script.via_points[:3]
    script.rest = 0.4
    folder = tmp_path_factory.mktemp("guided")
    return script, record_guided(script, RecordOptions(folder=folder)), folder


def hand_poses(demo):
    plant = MultibodyPlant(0.0)
    model = add_pepper(plant)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    torso, hand = plant.GetFrameByName("torso"), plant.GetFrameByName("r_hand_effector")
    for q in demo.joints:
        set_joint_positions(plant, context, model, dict(zip(demo.joint_names, q, strict=True)))
        yield hand.CalcPose(context, torso)


def assert_close(positions, rotations, poses):
    """Within 1 mm and 1 degree."""
    for p, q, X_TH in zip(positions, rotations, poses, strict=True):
        assert np.linalg.norm(p - X_TH.translation()) < 1e-3
        cosine = min(abs(X_TH.rotation().ToQuaternion().wxyz() @ q), 1.0)
        assert 2 * np.arccos(cosine) < np.radians(1.0)


def test_record_agrees_with_the_joints_it_was_made_of(recording):
    demo = recording[1].demonstration
    assert_close(demo.positions, demo.rotations, hand_poses(demo))


def test_record_of_a_known_path_at_20_cm_per_second_is_the_true_hand():
    """The figure: 1 mm and 1 degree, guided at 0.2 m/s."""
    builder = DiagramBuilder()
    positions = posture_positions(
        "stand", {"RShoulderPitch": 0.8, "RShoulderRoll": -0.4, "RElbowRoll": 1.0}
    )
    teaching = builder.AddSystem(Teaching("right", positions))
    plant = teaching.plant
    X_WH = plant.GetFrameByName("r_hand_effector").CalcPoseInWorld(plant.CreateDefaultContext())
    # A square of 10 cm, up, aside, down, back, with a turn.
    corners = [[0, 0, 0], [0, 0, 0.1], [0, -0.1, 0.1], [0, -0.1, 0], [0, 0, 0]]
    turns = [RollPitchYaw(0.2 * k, 0, 0).ToRotationMatrix() for k in (0, 1, 2, 1, 0)]
    poses = [
        RigidTransform(X_WH.rotation() @ R, X_WH.translation() + np.array(p))
        for R, p in zip(turns, corners, strict=True)
    ]
    path = GuidePath([0.2, 0.76, 1.32, 1.88, 2.44], poses)
    guide = builder.AddSystem(ScriptedGuide(path))
    builder.Connect(guide.guide_pose_output, teaching.GetInputPort("guide_pose"))
    builder.Connect(guide.guide_velocity_output, teaching.GetInputPort("guide_velocity"))
    session = Session(builder.Build(), teaching, RecordOptions())
    true_poses = {}

    def watch(root):
        context = plant.GetMyContextFromRoot(root)
        tick = round(root.get_time() / 0.01, 6)
        if tick == round(tick):
            torso = plant.GetFrameByName("torso")
            hand = plant.GetFrameByName("r_hand_effector")
            # The first time: a hair later, the plant has taken its next step.
            true_poses.setdefault(round(tick), hand.CalcPose(context, torso))

    session.simulator.set_monitor(watch)
    recorded, _, _ = session.run(2.8, "square")
    assert len(recorded.times) == 281
    speeds = np.linalg.norm(recorded.velocities[50:214], axis=1)
    assert np.mean(speeds) == pytest.approx(0.2, rel=0.1)
    samples = np.rint(recorded.times / 0.01).astype(int)
    assert_close(recorded.positions, recorded.rotations, [true_poses[k] for k in samples])


def test_the_hand_follows_the_guide_to_where_it_rests(recording):
    script, result, folder = recording
    demo = result.demonstration
    assert result.final_distance < 3e-3
    assert not result.stopped
    np.testing.assert_allclose(demo.positions[-1], script.via_points[-1].position, atol=4e-3)
    assert np.linalg.norm(demo.velocities[[0, -1]], axis=1).max() < 0.01
    assert demo.times[0] == 0.0
    np.testing.assert_array_equal(Demonstration.load(folder).positions, demo.positions)
    assert not (folder / PARTIAL).exists()


def stop_after(slices):
    asked = iter(range(1000))
    return lambda: next(asked) >= slices


def test_a_recording_that_is_stopped_keeps_what_it_has(tmp_path):
    options = RecordOptions(folder=tmp_path, should_stop=stop_after(12))
    result = record_guided(load_guide("reach"), options)
    assert result.stopped
    # 1.2 s less the half second of rest before the motion.
    assert result.demonstration.duration == pytest.approx(0.7, abs=0.06)
    assert len(Demonstration.load(tmp_path).times) == len(result.demonstration.times)


@pytest.mark.parametrize("slices", [0, 3])
def test_a_recording_that_is_stopped_before_the_hand_moves_leaves_nothing(tmp_path, slices):
    options = RecordOptions(folder=tmp_path, should_stop=stop_after(slices))
    with pytest.raises(StoppedError, match="before it held a motion"):
        record_guided(load_guide("reach"), options)
    assert list(tmp_path.iterdir()) == []


def test_the_script_of_joints_moves_one_at_a_time():
    script = load_joint_script("joints")
    path = joint_path(script)
    times = np.linspace(0, path.end_time(), 400)
    rates = np.array([path.EvalDerivative(t)[:, 0] for t in times])
    assert np.all(np.count_nonzero(np.abs(rates) > 1e-9, axis=1) <= 1)
    assert path.end_time() == pytest.approx(0.5 + 5.4 + 5 * 0.2)
    np.testing.assert_allclose(path.value(path.end_time())[:, 0], [0.9, -0.25, 1.6, 1.2, 0.8])
    script.rest = script.pause = 0.0
    assert joint_path(script).end_time() == pytest.approx(5.4)


@pytest.mark.parametrize("arm", ["right", "left"])
def test_dragged_joints_come_to_their_angles_and_can_be_learned(arm):
    script = load_joint_script("joints")
    script.moves, script.rest = script.moves[:2], 0.3
    script = script if arm == "right" else script.mirrored()
    result = record_joints(script)
    demo = result.demonstration
    side = 1 if arm == "right" else -1
    expected = [1.58, -0.7 * side, 1.6 * side, 0.52 * side, 0.03 * side]
    np.testing.assert_allclose(demo.joints[-1], expected, atol=5e-3)
    assert demo.joint_names[0] == ("R" if arm == "right" else "L") + "ShoulderPitch"
    assert result.final_distance < 1e-3
    assert result.distance_rms < 2e-3
    path = MovementPrimitive.fit(demo).rollout()
    assert np.linalg.norm(path.positions[-1] - demo.positions[-1]) < 5e-3


def test_the_pad_moves_the_hand_as_it_is_steered():
    result = record_pad(load_pad_script("pad"))
    positions = result.demonstration.positions
    assert result.final_distance < 0.01
    # First 1.2 s with the left stick right and ahead, the right one up, at up to 0.2 m/s each.
    shift = positions[110] - positions[0]
    assert shift[0] > 0.03
    assert shift[1] < -0.08
    assert shift[2] > 0.12
    assert positions[-1][0] > positions[0][0] + 0.15  # In front of the body.
