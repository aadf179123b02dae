"""Recording on a served robot: the arm goes limp, is led, and is held at the end."""

import json
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from served import served
from test_link import place

from pepper_drake.errors import InputError, StoppedError
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.robot_recording import RobotRecordOptions, record_robot
from pepper_drake.hardware.transport import RobotAccess
from pepper_drake.learning import Demonstration
from pepper_drake.learning.demonstrations.arm_chain import arm_chain
from pepper_drake.learning.demonstrations.recording import recorded_demonstration
from pepper_drake.live.session_file import SessionFolder, Taught
from pepper_drake.models.control_model import arm_joints
from pepper_drake.naoqi.constants import JOINTS

ARM = list(arm_joints("right"))
ROWS = [JOINTS.index(name) for name in ARM]
START = np.array([1.3, -0.3, 1.0, 0.8, 0.0])
GOAL = np.array([0.5, -0.5, 0.6, 1.2, 0.4])
SECONDS = 1.5


def lead(robot, ended, seen):
    """Leads the arm when it is limp, then does what ends the recording."""
    motion = robot.pepper.motion
    end = time.monotonic() + 20.0
    while time.monotonic() < end:
        if max(robot.do(lambda: motion.get_stiffnesses(ARM))) == 0.0:
            break
        time.sleep(0.02)
    seen["limp"] = robot.do(lambda: motion.get_stiffnesses(ARM))
    begin = time.monotonic()
    while (t := time.monotonic() - begin) < SECONDS + 0.4:
        s = min(t / SECONDS, 1.0)
        q = START + (GOAL - START) * (10 * s**3 - 15 * s**4 + 6 * s**5)
        robot.do(lambda q=q: robot.robot.lead(dict(zip(ARM, q.tolist(), strict=True))))
        time.sleep(0.005)
    ended(robot)


def recorded(folder, ended, **options):
    with served() as robot:
        place(robot)
        seen: dict = {}
        leader = threading.Thread(target=lead, args=(robot, ended, seen))
        leader.start()
        access = RobotAccess(robot.address)
        try:
            recording = record_robot(
                access, RobotRecordOptions(folder, disable_life=True, **options)
            )
        finally:
            leader.join(30)
        motion = robot.pepper.motion
        seen["stiff"] = robot.do(lambda: motion.get_stiffnesses(ARM))
        seen["arm"] = robot.do(lambda: robot.robot.state().positions[ROWS])
        seen["hand"] = robot.do(lambda: motion.get_position("RArm", 0, True))
        return recording, seen


def test_what_a_person_shows_is_recorded_and_the_arm_is_held(tmp_path):
    recording, seen = recorded(
        tmp_path, lambda robot: robot.do(lambda: robot.robot.touch("ChestBoard/Button"))
    )
    assert recording.ended_by == "ChestButtonPressed"
    assert seen["limp"] == [0.0] * 5
    np.testing.assert_allclose(seen["stiff"], 1.0)
    np.testing.assert_allclose(seen["arm"], GOAL, atol=0.01)  # Held where it was left.
    demonstration = Demonstration.load(tmp_path)
    assert 0.6 * SECONDS < demonstration.duration < SECONDS + 0.5
    np.testing.assert_allclose(demonstration.positions[-1], seen["hand"][:3], atol=2e-3)
    assert demonstration.joints is not None
    np.testing.assert_allclose(demonstration.joints[-1], GOAL, atol=0.02)
    assert recording.samples > 0.5 * SECONDS / 0.02


def test_a_head_touch_ends_it_and_a_hand_that_is_led_does_not(tmp_path):
    def touches(robot):
        robot.do(lambda: robot.robot.touch("RHand/Touch/Back"))
        time.sleep(0.2)
        robot.do(lambda: robot.robot.touch("Head/Touch/Front"))

    recording, _ = recorded(tmp_path, touches)
    assert recording.ended_by == "FrontTactilTouched"


def test_a_recording_without_a_motion_is_not_kept(tmp_path):
    with served() as robot:
        options = RobotRecordOptions(tmp_path, disable_life=True, should_stop=lambda: True)
        with pytest.raises(StoppedError, match="before it held a motion; nothing was kept"):
            record_robot(RobotAccess(robot.address), options)
        assert robot.do(lambda: robot.pepper.motion.get_stiffnesses(ARM)) == [1.0] * 5
    assert list(tmp_path.iterdir()) == []


def test_a_robot_that_is_lost_leaves_what_was_recorded(tmp_path):
    def freeze(robot):
        robot.do(lambda: setattr(robot.robot, "now", robot.robot.now + 3600.0))

    with pytest.raises(LinkFault) as lost:
        recorded(tmp_path, freeze)
    assert lost.value.word == "clock_jump"
    assert [path.name for path in tmp_path.iterdir()]


def test_the_app_records_and_refuses_what_only_a_simulation_can(tmp_path, monkeypatch):
    sys.path.insert(0, str(Path(__file__).parents[2] / "apps"))
    import record

    monkeypatch.setattr(
        sys,
        "argv",
        ["record.py", "--station", "naoqi", "--robot", "tcp://127.0.0.1:1", "--way", "joints"],
    )
    with pytest.raises(Exception, match="--way is for the simulation"):
        record.main()
    with served() as robot:
        place(robot)
        press = lambda it: it.do(lambda: it.robot.touch("ChestBoard/Button"))  # noqa: E731
        leader = threading.Thread(target=lead, args=(robot, press, {}))
        leader.start()
        arguments = ["--station", "naoqi", "--robot", robot.address, "--disable-life"]
        monkeypatch.setattr(sys, "argv", ["record.py", *arguments, "--output", str(tmp_path)])
        assert record.main() == 0
        leader.join(30)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["ended_by"] == "ChestButtonPressed"
    assert report["outcome"] == "recorded"


def test_teaching_adds_what_a_robot_was_shown_to_a_session_that_the_page_goes_on_with(
    tmp_path, monkeypatch
):
    sys.path.insert(0, str(Path(__file__).parents[2] / "apps"))
    import teach

    times = np.linspace(0.0, SECONDS, 76)
    s = times / SECONDS
    joints = START + np.outer(10 * s**3 - 15 * s**4 + 6 * s**5, GOAL - START)
    folder = SessionFolder(tmp_path)
    folder.record.arm = "right"
    samples = np.column_stack((*arm_chain("right").hand(joints), joints))
    earlier = folder.named(recorded_demonstration(times, samples, ARM))
    folder.write(Taught((earlier,)))
    press = lambda it: it.do(lambda: it.robot.touch("ChestBoard/Button"))  # noqa: E731
    with served() as robot:
        arguments = ["--station", "naoqi", "--robot", robot.address, "--disable-life"]
        monkeypatch.setattr(sys, "argv", ["teach.py", *arguments, "--output", str(tmp_path)])
        place(robot)
        leader = threading.Thread(target=lead, args=(robot, press, {}))
        leader.start()
        assert teach.main() == 0
        leader.join()
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["ended_by"] == "ChestButtonPressed"
    assert (report["arm"], report["demonstrations"]) == ("right", 2)
    taught = SessionFolder(tmp_path).taught("right")
    assert [motion.name for motion in taught.shown] == ["01", "02"]
    assert taught.primitive is not None
    assert taught.learned is taught.shown[-1]
    ends = [motion.positions[-1] for motion in taught.shown]
    np.testing.assert_allclose(taught.primitive.goal, np.mean(ends, axis=0), atol=5e-3)
    monkeypatch.setattr(sys, "argv", [*sys.argv, "--script", "story"])
    with pytest.raises(InputError, match="--script is for the simulation"):
        teach.main()
