"""Slow motions that do not look, and the way back after a run that ended in order."""

from types import SimpleNamespace

import numpy as np

from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.robot_run import HardwareRun, RobotRun
from pepper_drake.hardware.slow_motion import SLOW, STANDS, retraced_path, slow_motion
from pepper_drake.hardware.transport import RobotAccess
from pepper_drake.models.control_model import BODY_JOINTS, CONTROL_PERIOD, arm_joints, body_indices

ARM = body_indices(arm_joints("right"))


def test_a_slow_motion_goes_along_all_postures_and_is_never_fast():
    postures = np.zeros((4, 15))
    postures[1, 3], postures[2, 3], postures[3, 3] = 0.4, 0.4, 0.1
    postures[3, 5] = -0.2
    motion = slow_motion(postures)
    speeds = np.abs(np.diff(motion.positions, axis=0)) / CONTROL_PERIOD
    assert 0.9 * SLOW < speeds.max() <= 1.001 * SLOW
    assert motion.times[0] == STANDS
    np.testing.assert_allclose(motion.positions[[0, -1]], postures[[0, 3]], atol=1e-12)
    assert np.abs(motion.positions - postures[1]).max(axis=1).min() < 0.01


def test_the_way_back_leaves_loops_and_rests_out():
    out = np.linspace(0.0, 1.0, 101)[:, None] * [1.0, 0.5]
    aside = out[50] + np.linspace(0.0, 0.3, 31)[:, None] * [0.0, 1.0]
    way = np.concatenate((out[:1].repeat(40, 0), out[:51], aside, aside[::-1], out[50:]))
    back = retraced_path(way)
    np.testing.assert_array_equal(back[[0, -1]], [out[-1], out[0]])
    assert np.abs(np.diff(back, axis=0)).max() <= 0.021
    np.testing.assert_allclose(back[:, 1], 0.5 * back[:, 0], atol=0.02)
    assert len(retraced_path(out[:1].repeat(40, 0))) <= 2  # It never left.


def run_with_way(fault=None):
    said, motions = [], []
    run = RobotRun(HardwareRun(RobotAccess("tcp://127.0.0.1:1"), say=said.append), "right")
    way = np.zeros((60, len(BODY_JOINTS)))
    way[:, ARM[0]] = np.linspace(1.5, 0.6, 60)
    way[:, 0] = np.linspace(0.0, 0.5, 60)  # The head has turned and stays so.
    run._path, run.fault = list(way), fault
    here = way[-1]
    run.link = SimpleNamespace(
        state=lambda: {"positions": here},
        last_fault=lambda: None,
        hold=lambda: said.append("held"),
        hand_over=lambda: said.append("handed over") or True,
    )
    run.go_along = motions.append
    return run, said, motions


def test_the_arm_goes_back_the_way_that_it_came_before_it_is_handed_over():
    run, said, motions = run_with_way()
    run._end(None)
    (motion,) = motions
    last = motion.positions[-1]
    assert last[ARM[0]] == 1.5
    assert last[0] == 0.5
    assert "goes back the way that it came" in said[0]
    assert said[-1] == "handed over"


def test_after_a_fault_or_an_interruption_it_is_handed_over_where_it_is():
    run, _, motions = run_with_way(LinkFault("dead_man"))
    run._end(None)
    interrupted, said, more = run_with_way()
    interrupted.is_stopped = True
    interrupted._end(None)
    assert motions == more == []
    assert said[-1] == "handed over"


def test_who_lets_the_key_go_on_the_way_back_spoils_no_run():
    run, said, _ = run_with_way()
    run.go_along = lambda _: setattr(run, "fault", LinkFault("dead_man"))
    run._end(None)
    assert run.fault is None
    assert "dead_man: the dead man's switch was let go" in said
    assert said[-1] == "handed over"
