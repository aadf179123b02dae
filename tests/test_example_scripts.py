"""The scripts of examples/ do what they say."""

import re
import runpy
from pathlib import Path

import numpy as np

from tests.printed import missing, shown_lines

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_another_robot_reaches_past_the_ball_and_without_the_coupling_through_it(capsys):
    runpy.run_path(str(EXAMPLES / "cartesian_robot.py"), run_name="__main__")
    printed = capsys.readouterr().out
    assert missing(shown_lines("docs/howto/parts.md"), printed) == []
    errors, gaps = np.array(
        [re.findall(r"([-+]?[\d.]+) mm", line) for line in printed.splitlines()], dtype=float
    ).T
    assert np.all(errors < 2.0)
    assert gaps[0] < -10.0
    assert 5.0 < gaps[1] < 50.0
