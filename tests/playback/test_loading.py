import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.models.pepper import BODY_JOINTS, MODELS_DIR
from pepper_drake.playback.loading import load_motion
from pepper_drake.results.reach_log import ReachLog

REACH = MODELS_DIR / "demonstrations" / "reach"


def test_a_run_says_what_moved_where_and_what_came_of_it(runs):
    motion = load_motion(runs[1])
    assert (motion.name, motion.arm) == ("high", "right")
    assert motion.duration == pytest.approx(2.5)
    assert motion.arm_starts == pytest.approx(1.0)
    assert motion.stages == ((0.0, "looking"), (1.0, "reaching"))
    assert set(motion.positions) == {
        *BODY_JOINTS,
        *("BaseX", "BaseY", "BaseYaw"),
        *("goal_object_x", "goal_object_y", "goal_object_z"),
    }
    assert motion.positions["BaseX"] == pytest.approx(0.6)
    assert motion.positions["goal_object_z"][-1] == pytest.approx(0.08)
    assert motion.figures["hand to goal [mm]"] == pytest.approx(1.1)
    assert motion.figures["hand path length [m]"] == pytest.approx(np.hypot(0.1, 0.2))
    assert "tracking error [mm]" not in motion.figures, "the report has none"
    assert motion.signals["hand to goal"].values[[0, -1]] == pytest.approx([300.0, 50.0])


def test_the_log_stands_for_its_folder(runs):
    assert load_motion(runs[0] / "log.npz").name == "low"


@pytest.fixture
def run(runs, tmp_path):
    return shutil.copytree(runs[1], tmp_path / "run")


def _without(run, name):
    (run / name).unlink()


def _written(run, name, text):
    (run / name).write_text(text)


def _with_log(run, **arrays):
    log = ReachLog.load(run / "log.npz")
    replace(log, **arrays).save(run / "log.npz")


def _lacking(run, name):
    with np.load(run / "log.npz") as data:
        arrays = {key: data[key] for key in data if key != name}
    np.savez(run / "log.npz", **arrays)


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda run: _written(run, "log.npz", "PK, but cut off"), r"log\.npz: this is not a log"),
        (lambda run: _lacking(run, "object_offset_m"), r"log\.npz: the log lacks object_offset_m"),
        (
            lambda run: _with_log(run, joint_position_rad=np.full((251, 15), np.nan)),
            r"log\.npz: joint_position_rad holds numbers that are not finite",
        ),
        (
            lambda run: _with_log(run, object_offset_m=np.zeros((251, 6))),
            r"object_offset_m has 6 columns, but in scene\.yaml 1 objects have a path",
        ),
        (lambda run: _without(run, "scene.yaml"), r"the run lacks scene\.yaml"),
        (lambda run: _written(run, "scene.yaml", "goal: [}"), r"scene\.yaml line 1: not valid"),
        (lambda run: _without(run, "report.json"), r"report\.json: the report is missing"),
        (lambda run: _written(run, "report.json", "{"), r"report\.json: this is not a report"),
        (lambda run: _written(run, "report.json", "{}"), r"report\.json: the report says no"),
    ],
)
def test_what_is_broken_is_named_in_one_sentence(run, spoil, message):
    spoil(run)
    with pytest.raises(InputError, match=message) as info:
        load_motion(run)
    assert "\n" not in str(info.value)


def test_a_run_that_never_reached_has_no_way_of_its_hand(run):
    _with_log(run, mode=np.zeros(251, dtype=np.int64))
    motion = load_motion(run)
    assert motion.arm_starts == motion.times[-1]
    assert "hand path length [m]" not in motion.figures


def test_a_report_may_hold_more_and_other_things(run):
    report = json.loads((run / "report.json").read_text()) | {"final_position_error": "unknown"}
    _written(run, "report.json", json.dumps(report))
    assert "hand to goal [mm]" not in load_motion(run).figures


@pytest.mark.parametrize("name", ["", "nowhere", "nothing.npz"])
def test_nothing_to_play_back_says_what_can_be(tmp_path, name):
    with pytest.raises(InputError, match="nothing to play back; give the folder of a run"):
        load_motion(tmp_path / name)


def test_a_demonstration_moves_the_recorded_joints():
    motion = load_motion(REACH)
    demo = Demonstration.load(REACH)
    assert motion.arm == "right"
    assert motion.scene is None
    assert set(motion.positions) == set(demo.joint_names)
    assert motion.hand_T is None, "the joints tell"
    assert motion.figures["arm moves for [s]"] == demo.duration


def test_a_demonstration_without_joints_shows_its_hand(tmp_path):
    demo = Demonstration.load(REACH).mirrored()
    replace(demo, joints=None, joint_names=()).save(tmp_path / "left")
    motion = load_motion(tmp_path / "left")
    assert motion.arm == "left"
    np.testing.assert_allclose(motion.hand_T, demo.positions)
    assert motion.hand_rotations_T.shape == (len(demo.times), 4)


def test_what_was_taught_in_the_browser_is_found_in_its_folder(tmp_path):
    Demonstration.load(REACH).save(tmp_path / "taught" / "demonstration")
    motion = load_motion(tmp_path / "taught")
    assert motion.name == "taught"
    assert motion.positions


@pytest.fixture
def reproduction(tmp_path):
    """A run as `apps/reproduce.py` leaves it: the left shoulder rolls out, the hand goes up."""
    folder = tmp_path / "pushed"
    folder.mkdir()
    times = np.arange(101) * 0.01
    rest = np.zeros((101, 4))
    hand = np.column_stack([np.full(101, 0.2), np.full(101, 0.2), 0.1 * times])
    np.savez_compressed(
        folder / "log.npz",
        time_s=times,
        phase=np.where(times < 0.5, 1.0, 0.1),
        slowdown=np.linspace(0.0, 2.0, 101),
        hand_position_torso_m=hand,
        desired_position_torso_m=hand,
        joint_position_rad=np.column_stack([rest[:, :1], times, rest[:, :3]]),
        goal_position_torso_m=np.array([0.2, 0.2, 0.11]),
    )
    report = {"outcome": "reached", "arm": "left", "final_position_error": 0.01}
    (folder / "report.json").write_text(json.dumps(report))
    return folder


def test_a_reproduction_moves_its_arm_and_says_when_it_waits(reproduction):
    motion = load_motion(reproduction)
    assert (motion.name, motion.arm, motion.scene) == ("pushed", "left", None)
    assert motion.arm_starts == pytest.approx(0.5)
    np.testing.assert_allclose(motion.positions["LShoulderRoll"], motion.times)
    assert motion.signals["waiting"].values[-1] == 2.0
    assert motion.signals["hand to goal"].values[-1] == pytest.approx(10.0)
    assert motion.figures["hand to goal [mm]"] == pytest.approx(10.0)
    assert motion.figures["hand path length [m]"] == pytest.approx(0.1)


def test_a_reproduction_by_no_arm_is_named(reproduction):
    _written(reproduction, "report.json", '{"outcome": "reached", "arm": "third"}')
    with pytest.raises(InputError, match=r"report\.json: arm is third; it must be one of left"):
        load_motion(reproduction)


def test_a_primitive_is_rolled_out(tmp_path):
    demo = Demonstration.load(REACH)
    MovementPrimitive.fit(demo).save(tmp_path / "reach.yaml")
    motion = load_motion(tmp_path / "reach.yaml")
    assert (motion.name, motion.arm) == ("reach", "right")
    MovementPrimitive.fit(demo).save(tmp_path / "learned" / "primitive.yaml")
    assert load_motion(tmp_path / "learned" / "primitive.yaml").name == "learned"
    assert load_motion(tmp_path / "learned").name == "learned"
    np.testing.assert_allclose(motion.hand_T[-1], demo.positions[-1], atol=2e-3)
