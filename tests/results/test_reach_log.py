from dataclasses import fields, replace

import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.reporting.reach_figures import save_reach_figures
from pepper_drake.results.reach_log import ReachLog


def make_log(modes, count=200):
    rng = np.random.default_rng(0)
    time = np.arange(count) * 0.01
    s = np.linspace(0, 1, count)[:, None]
    hand = np.array([0.1, -0.2, -0.2]) + s * [0.2, 0.0, 0.25]
    return ReachLog(
        time_s=time,
        mode=np.repeat(modes, -(-count // len(modes)))[:count].astype(np.int64),
        movement_origin=np.repeat([0, 1], -(-count // 2))[:count].astype(np.int64),
        joint_position_rad=rng.normal(size=(count, 15)),
        joint_command_rad=rng.normal(size=(count, 15)),
        base_pose_m_m_rad=np.zeros((count, 3)),
        object_offset_m=rng.normal(size=(count, 3)),
        hand_position_torso_m=hand,
        desired_position_torso_m=hand + 0.001,
        goal_position_torso_m=np.tile(hand[-1], (count, 1)),
        goal_distance_m=np.linalg.norm(hand - hand[-1], axis=1),
        orientation_error_rad=np.linspace(1.0, 0.1, count),
        axis_error_rad=np.linspace(0.5, 0.05, count),
        phase=np.linspace(1, 0.01, count),
        tau_s=np.full(count, 2.0),
        coupling_m_per_s2=rng.normal(size=(count, 3)),
        clearance_m=np.full(count, 0.05),
        seen_clearance_m=np.full(count, 0.06),
        cloud_torso_m=rng.uniform(-0.5, 0.5, (50, 3)),
        demonstration_m=hand[::4],
        taught_path_torso_m=hand[::2],
        hand_opening=rng.uniform(0.0, 1.0, (count, 2)),
    )


ALL_WELL = [ReachMode.LOOKING, ReachMode.DRIVING, ReachMode.REACHING, ReachMode.HOLDING]


def test_a_log_comes_back_as_it_was_saved(tmp_path):
    log = make_log(ALL_WELL)
    log.save(tmp_path / "log.npz")
    again = ReachLog.load(tmp_path / "log.npz")
    for f in fields(ReachLog):
        np.testing.assert_array_equal(getattr(again, f.name), getattr(log, f.name))


def test_a_log_of_before_the_hands_moved_is_read_without_them(tmp_path):
    log = make_log(ALL_WELL)
    log.save(tmp_path / "log.npz")
    with np.load(tmp_path / "log.npz") as arrays:
        older = {name: arrays[name] for name in arrays if name != "hand_opening"}
    np.savez(tmp_path / "old.npz", **older)
    assert ReachLog.load(tmp_path / "old.npz").hand_opening.shape == (len(log.time_s), 0)
    np.savez(tmp_path / "bad.npz", **older, hand_opening=np.zeros((3, 2)))
    with pytest.raises(InputError, match="hand_opening is"):
        ReachLog.load(tmp_path / "bad.npz")


def test_every_array_has_its_unit_in_its_name():
    without = {"mode", "movement_origin", "phase", "hand_opening"}
    units = ("_s", "_m", "_rad", "_m_per_s2")
    assert all(f.name in without or f.name.endswith(units) for f in fields(ReachLog))


@pytest.mark.parametrize("content", [None, b"", b"no archive", b"PK\x03\x04 cut off", "lacking"])
def test_what_is_no_log_is_named(tmp_path, content):
    path = tmp_path / "log.npz"
    if content == "lacking":
        np.savez(path, time_s=np.zeros(3))
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"log\.npz: .*; (run|record)"):
        ReachLog.load(path)


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("time_s", np.zeros(200)),
        ("time_s", np.array([0.0])),
        ("phase", np.ones(199)),
        ("joint_position_rad", np.zeros((200, 14))),
        ("object_offset_m", np.zeros((200, 4))),
    ],
)
def test_arrays_that_do_not_fit_together_are_named(tmp_path, name, wrong):
    path = tmp_path / "log.npz"
    replace(make_log(ALL_WELL), **{name: wrong}).save(path)
    with pytest.raises(InputError, match=rf"log\.npz: {name} .*; record the run again"):
        ReachLog.load(path)


def test_a_log_with_a_damaged_array_is_no_log(tmp_path):
    path = tmp_path / "log.npz"
    make_log(ALL_WELL).save(path)
    content = bytearray(path.read_bytes())
    middle = content.find(b"joint_position_rad") + 2000
    content[middle : middle + 64] = bytes(64)
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"log\.npz: this is not a log of a run .*; record"):
        ReachLog.load(path)


@pytest.mark.parametrize("modes", [ALL_WELL, [ReachMode.LOOKING, ReachMode.FAILED]])
@pytest.mark.filterwarnings("error")
def test_figures_are_drawn_whether_the_arm_moved_or_not(tmp_path, modes):
    paths = save_reach_figures(make_log(modes), tmp_path)
    assert [path.name for path in paths] == ["path.png", "timeline.png"]
    for path in paths:
        assert path.read_bytes().startswith(b"\x89PNG")
        assert path.stat().st_size > 20_000
