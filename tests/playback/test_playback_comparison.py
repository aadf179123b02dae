import numpy as np

from pepper_drake.playback.comparison import compare, table
from pepper_drake.playback.motion import Motion


def motion(name, **figures):
    return Motion(name=name, arm="right", times=np.array([0.0, 1.0]), figures=figures)


ONE = motion("one", **{"outcome": "reached", "way [m]": 0.8049, "clearance [mm]": 21.56})
OTHER = motion("the other", **{"outcome": "failed", "reason": "touched", "way [m]": 1.5})


def test_each_motion_has_its_column_and_each_figure_its_row():
    assert compare([ONE, OTHER]) == {
        "outcome": ["reached", "failed"],
        "way [m]": ["0.80", "1.50"],
        "clearance [mm]": ["21.6", ""],
        "reason": ["", "touched"],
    }


def test_what_nobody_has_is_left_out():
    assert "reason" not in compare([motion("one", reason="", outcome="reached")])


def test_a_table_lines_up():
    lines = table([ONE, OTHER]).splitlines()
    assert lines[0].split() == ["one", "the", "other"]
    assert lines[1].endswith("reached     failed")
    assert len({len(line) for line in (lines[0], lines[1], lines[2])}) == 1
