import numpy as np
import pytest

from pepper_drake.playback.bodies import Frames
from pepper_drake.playback.comparison import FARTHEST, compare, farthest, table
from pepper_drake.playback.motion import Motion

STRAIGHT = np.column_stack([np.linspace(0.0, 1.0, 101), np.zeros(101), np.zeros(101)])
BENT = STRAIGHT + np.outer(np.sin(np.pi * STRAIGHT[:, 0]), [0.0, 0.0, 0.04])


def run(name, way=STRAIGHT, **figures):
    times = np.array([0.0, 1.0])
    return Frames(
        motion=Motion(name=name, arm="right", times=times, figures=figures),
        times=times,
        clock=times,
        yaw=0.0,
        bodies=(),
        hand_W=way,
        shown_W=np.zeros((0, 3)),
        cloud_W=np.zeros((0, 3)),
    )


ONE = run("one", **{"outcome": "reached", "way [m]": 0.8049, "clearance [mm]": 21.56})
OTHER = run("the other", BENT, **{"outcome": "failed", "reason": "touched", "way [m]": 1.5})


def test_each_motion_has_its_column_and_each_figure_its_row():
    assert compare([ONE, OTHER]) == {
        "outcome": ["reached", "failed"],
        "way [m]": ["0.80", "1.50"],
        "clearance [mm]": ["21.6", ""],
        "reason": ["", "touched"],
        FARTHEST: ["", "40.0"],
    }


def test_one_motion_is_compared_with_none():
    assert FARTHEST not in compare([OTHER])


def test_ways_are_compared_as_ways_whoever_is_faster():
    assert farthest(BENT, STRAIGHT) == pytest.approx(0.04)
    slower = np.repeat(STRAIGHT, 2, axis=0)
    assert farthest(slower, STRAIGHT) == pytest.approx(0.0)
    assert farthest(STRAIGHT[:50], STRAIGHT) == pytest.approx(0.0), "it only ends earlier"
    assert farthest(STRAIGHT, STRAIGHT[:51]) == pytest.approx(0.5), "it goes on"


def test_what_nobody_has_is_left_out():
    assert "reason" not in compare([run("one", reason="", outcome="reached")])


def test_a_table_lines_up():
    lines = table([ONE, OTHER]).splitlines()
    assert lines[0].split() == ["one", "the", "other"]
    assert lines[1].endswith("reached     failed")
    assert len({len(line) for line in (lines[0], lines[1], lines[2])}) == 1
