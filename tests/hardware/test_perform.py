"""A served robot performs a movement that was taught, as the app has it."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from served import right_hand, served_apart

sys.path.insert(0, str(Path(__file__).parents[2] / "apps"))


def app(name, monkeypatch, *words):
    module = __import__(name)
    monkeypatch.setattr(sys, "argv", [f"{name}.py", *words])
    return module.main()


@pytest.mark.parametrize("link", ["wire"])
def test_a_robot_performs_a_movement(tmp_path, monkeypatch, link):
    with served_apart() as robot:
        words = ("--station", "naoqi", "--robot", robot.address, "--disable-life", "--link", link)
        code = app(
            "reproduce",
            monkeypatch,
            *words,
            "--unattended",
            "--hold-at-end",
            "--output",
            str(tmp_path),
        )
        hand = robot.do(right_hand)
    report = json.loads((tmp_path / "report.json").read_text())
    assert code == 0, report
    assert report["outcome"] == "reached"
    assert report["final_position_error"] < 0.005
    log = np.load(tmp_path / "log.npz")
    np.testing.assert_allclose(hand, log["goal_position_torso_m"], atol=0.005)
