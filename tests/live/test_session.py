import shutil
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.errors import PepperDrakeError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.live.session import LiveSession, Mode
from pepper_drake.live.session_file import SessionFolder
from pepper_drake.models.control_model import arm_joints, body_indices
from pepper_drake.systems.robot.arm_command import ArmMode

BESIDE_GOAL = RigidTransform(RollPitchYaw(1.57, -0.27, 0.1), [0.28, -0.2, 0.14])
VIA = RigidTransform(RollPitchYaw(0.2, 0.5, -0.4), [0.17, -0.38, 0.0])


def go_on(session, seconds, *, until=()):
    """Advances; returns the fastest that a joint of the robot moved, rad/s."""
    end, fastest = session.simulation.time + seconds, 0.0
    modes = (until,) if isinstance(until, Mode) else until
    while session.simulation.time < end and session.mode not in modes:
        session.advance()
        fastest = max(fastest, np.abs(arm_velocity(session)).max())
    return fastest


def arm_velocity(session):
    station = session.simulation.diagram.station
    context = station.GetMyContextFromRoot(session.simulation.simulator.get_context())
    velocity = station.GetOutputPort("joint_velocity").Eval(context)
    return velocity[body_indices(arm_joints(session.simulation.arm))]


def jerk_of_next_frame(session):
    """Returns how far the joints come from where their velocity takes them in a frame, rad."""
    before, velocity = session.simulation.joints(), arm_velocity(session)
    time = session.simulation.time
    session.advance()
    expected = before + (session.simulation.time - time) * velocity
    return np.abs(session.simulation.joints() - expected).max()


def lead(session, X_TG, seconds):
    session.simulation.set_guide_target(X_TG)
    go_on(session, seconds)


@pytest.fixture(scope="module")
def story(tmp_path_factory, make_session):
    """A session that has been taught and has reached, and what was seen on the way."""
    folder = tmp_path_factory.mktemp("story")
    session, seen = make_session(folder), {"folder": folder}
    session.record()
    lead(session, VIA, 1.6)
    seen["partial"] = (folder / "recording" / "recording.partial.csv").read_text()
    lead(session, BESIDE_GOAL, 2.4)
    session.stop()
    seen["recorded"] = session.status
    session.learn()
    seen["learned"] = session.status
    seen["taught"] = shutil.copytree(folder, tmp_path_factory.mktemp("taught") / "session")
    session.reach()
    seen["stiffened"] = jerk_of_next_frame(session)
    seen["back"] = go_on(session, 15, until=Mode.REACHING)
    seen["started"] = jerk_of_next_frame(session)
    seen["start"] = session.simulation.hand_pose().translation()
    seen["reaching"] = go_on(session, 15, until=Mode.HOLDING)
    seen["distance"] = session.simulation.goal_distance()
    session.simulation.set_offset("goal_object", np.array([0.0, 0.0, 0.05]))
    go_on(session, 0.2)
    seen["distance at once"] = session.simulation.goal_distance()
    seen["following"] = go_on(session, 2.5)
    seen["distance after"] = session.simulation.goal_distance()
    session.save()
    seen["saved"] = session.status
    return session, seen


def test_a_hand_that_is_led_is_recorded_and_learned(story):
    session, seen = story
    assert seen["recorded"].startswith("Recorded ")
    assert seen["learned"].startswith("Learned ")
    demonstration = session.demonstration
    assert demonstration.joint_names[0] == "RShoulderPitch"
    near_via = np.linalg.norm(demonstration.positions - VIA.translation(), axis=1).min()
    assert near_via < 0.03
    np.testing.assert_allclose(demonstration.positions[-1], BESIDE_GOAL.translation(), atol=0.01)
    np.testing.assert_allclose(session.primitive.goal, demonstration.positions[-1])


def test_the_arm_goes_back_and_reaches_and_follows_a_goal_that_moves(story):
    _, seen = story
    start = seen["start"] - story[0].demonstration.positions[0]
    assert np.linalg.norm(start) < 0.02
    assert seen["distance"] < 0.006
    assert seen["distance at once"] > 0.01
    assert seen["distance after"] < 0.006


def test_nothing_jumps(story):
    # Commands keep to half of the rated velocities, 3.7 rad/s; the servos overshoot a little.
    _, seen = story
    for phase in ("back", "reaching", "following"):
        assert seen[phase] < 4.4
    # A limp arm that still swings is braked, by at most 2 rad/s over half a frame.
    assert seen["stiffened"] < 0.035
    assert seen["started"] < 0.01


def test_a_recording_is_on_disk_while_it_is_made_and_afterwards(story):
    session, seen = story
    rows = seen["partial"].splitlines()
    assert rows[0].startswith("time,x,y,z,qw,qx,qy,qz,RShoulderPitch")
    assert len(rows) > 150
    recording = seen["folder"] / "recording"
    assert not (recording / "recording.partial.csv").exists()
    kept = Demonstration.load(recording)
    np.testing.assert_allclose(kept.positions, session.demonstration.positions, atol=1e-8)


def test_what_is_saved_can_be_loaded_and_performed(story):
    session, seen = story
    assert "Saved the demonstration and the primitive" in seen["saved"]
    saved = MovementPrimitive.load(seen["folder"] / "primitive.yaml")
    np.testing.assert_allclose(saved.rollout().positions, session.primitive.rollout().positions)
    Demonstration.load(seen["folder"] / "demonstration")


def test_a_session_goes_on_after_a_restart(story):
    """On the same robot, which is moved elsewhere in between."""
    session, seen = story
    simulation = session.simulation
    simulation.place("goal_object", np.zeros(3))
    again = LiveSession(simulation, SessionFolder(seen["folder"]))
    assert again.resumed == "1 demonstration and a learned movement"
    page = Path(__file__).parents[2] / "docs" / "howto" / "teaching.md"
    assert f"Resumed the session in out/teach: {again.resumed}. " in page.read_text()
    np.testing.assert_allclose(simulation.offset("goal_object"), [0, 0, 0.05])
    (motion,) = again.shown
    np.testing.assert_allclose(motion.positions, session.demonstration.positions, atol=1e-8)
    assert again.next_button == "Reach"
    again.undo()
    assert "nothing to undo" in again.status


def test_stop_hands_the_arm_over_where_it_is(story):
    session, _ = story
    session.stop()
    assert session.mode == Mode.GUIDED
    assert session.simulation.arm_mode == ArmMode.LIMP
    assert jerk_of_next_frame(session) < 0.01
    before = session.simulation.hand_pose().translation()
    go_on(session, 0.5)
    assert np.linalg.norm(session.simulation.hand_pose().translation() - before) < 0.01
    lead(session, RigidTransform(BESIDE_GOAL.rotation(), before + [-0.05, -0.05, 0]), 1.0)
    moved = session.simulation.hand_pose().translation() - before
    np.testing.assert_allclose(moved, [-0.05, -0.05, 0], atol=0.02)


@pytest.fixture(scope="module")
def idle(make_session):
    """A robot that one session after another has."""
    return make_session().simulation


def test_buttons_that_make_no_sense_say_so_and_change_nothing(idle, tmp_path):
    session = LiveSession(idle, tmp_path)
    for button, words in (
        (session.stop, "Nothing is running"),
        (session.learn, "nothing to learn"),
        (session.reach, "nothing to perform"),
        (session.save, "nothing to save"),
    ):
        button()
        assert words in session.status
        assert session.mode == Mode.GUIDED
    session.record()
    session.record()
    assert "Already recording" in session.status
    session.reach()
    assert "press Stop before Reach" in session.status
    session.learn()
    assert "press Stop before Learn" in session.status
    assert session.mode == Mode.RECORDED
    session.advance()
    session.stop()
    assert "hardly moved" in session.status
    assert session.demonstration is None
    assert list((tmp_path / "recording").iterdir()) == []


def test_a_notice_gives_way_to_what_can_be_done_next(idle):
    session = LiveSession(idle)
    described = session.status
    session.stop()
    assert session.status != described
    go_on(session, 4.2)
    assert session.status == described


def test_an_interrupted_recording_is_not_overwritten(idle, tmp_path):
    recording = tmp_path / "recording"
    recording.mkdir()
    (recording / "recording.partial.csv").write_text("kept\n")
    session = LiveSession(idle, tmp_path)
    session.record()
    assert "interrupted recording" in session.status
    assert session.mode == Mode.GUIDED
    assert (recording / "recording.partial.csv").read_text() == "kept\n"


def test_what_cannot_be_moved_is_named(idle):
    with pytest.raises(PepperDrakeError, match='"tray" cannot be moved; ball, goal_object can'):
        idle.set_offset("tray", np.zeros(3))


@pytest.mark.render
def test_with_cameras_the_goal_is_seen_and_the_cloud_follows_the_ball(make_session):
    session = make_session(cameras=True)
    go_on(session, 1.5)
    simulation = session.simulation
    assert simulation.goal_is_seen()
    X_TG = simulation.torso_pose().inverse() @ simulation.scene.goal.pose()
    X_TG = X_TG @ simulation.scene.pre_grasp()
    np.testing.assert_allclose(simulation.goal_position(), X_TG.translation(), atol=0.004)
    (ball,) = (o for o in simulation.scene.obstacles if o.name == "ball")
    offsets = np.linalg.norm(simulation.cloud() - ball.position, axis=1)
    assert np.count_nonzero(np.abs(offsets - ball.size[0]) < 0.012) > 20
    moved = np.array([0.0, 0.08, 0.03])
    simulation.set_offset("ball", moved)
    go_on(session, 2.0)
    offsets = np.linalg.norm(simulation.cloud() - ball.position - moved, axis=1)
    assert np.count_nonzero(np.abs(offsets - ball.size[0]) < 0.012) > 20


def true_distance(simulation, name):
    """Distance from an object to Pepper [m], at most 0.1; negative where they overlap."""
    station = simulation.diagram.station
    context = station.GetMyContextFromRoot(simulation.simulator.get_context())
    query = station.GetOutputPort("ground_truth.query").Eval(context)
    inspector, least = query.inspector(), 0.1
    for pair in query.ComputeSignedDistancePairwiseClosestPoints(least):
        frames = [inspector.GetName(inspector.GetFrameId(g)) for g in (pair.id_A, pair.id_B)]
        robot = [frame for frame in frames if frame.startswith("pepper::")]
        if robot and any(frame.endswith(name) for frame in frames):
            least = min(least, pair.distance)
    return least


@pytest.mark.render
@pytest.mark.parametrize("share", [0.7, 0.8])
def test_a_ball_in_the_way_is_not_touched_and_the_page_says_so_until_it_is_gone(
    make_session, story, share
):
    """It is 0.33 m from the depth camera, too near to be measured."""
    session = make_session(story[1]["taught"], cameras=True)
    assert session.resumed == "1 demonstration and a learned movement"
    simulation = session.simulation
    demonstrated = session.demonstration.positions
    on_the_way = simulation.torso_pose() @ demonstrated[int(share * len(demonstrated))]
    (ball,) = (o for o in simulation.scene.obstacles if o.name == "ball")
    session.reach()
    go_on(session, 15, until=Mode.LOOKING)
    simulation.set_offset("ball", on_the_way + [0.0, -0.03, -0.02] - ball.position)
    seen, distances = [], []
    while session.mode != Mode.HOLDING and simulation.time < 26:
        go_on(session, 0.1)
        seen += [session.mode] if session.mode not in seen else []
        distances.append(true_distance(simulation, "ball"))
    assert seen[:2] == [Mode.LOOKING, Mode.PLANNING], session.status
    assert Mode.STOPPED not in seen, session.status
    assert min(distances) > 0.0
    if session.mode == Mode.WAITING:
        assert "waits for it to go" in session.status
        simulation.set_offset("ball", np.array([0.3, -0.3, -0.5]))
        # A stop is final.
        go_on(session, 30, until=(Mode.HOLDING, Mode.STOPPED))
    assert session.mode == Mode.HOLDING, session.status
    assert simulation.has_arrived(), session.status


def test_a_person_is_attended_to_several_times_a_frame(idle):
    session, times = LiveSession(idle), []
    start = idle.time
    for _ in range(2):
        session.advance(lambda: times.append(idle.time))
    np.testing.assert_allclose(times, start + np.arange(8) / 128)
    assert idle.time == start + 2 / 32
