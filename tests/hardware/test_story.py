"""A movement is shown to a served robot, learned, and performed by it: the apps, one after another.

Over our own wire, which needs no library of the maker.
"""

import importlib
import json
import sys
import threading
import time
from pathlib import Path

import numpy as np
from served import lead, limp, press_chest, right_hand, served_apart, stand

from pepper_drake.models.control_model import arm_joints
from pepper_drake.models.pepper import POSTURES

ARM = list(arm_joints("right"))
START = np.array([POSTURES["stand"][name] for name in ARM])
END = START + [-0.6, -0.1, -0.3, 0.4, 0.2]
SECONDS = 1.0


def app(name, monkeypatch, *words):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "apps"))
    module = importlib.import_module(name)
    monkeypatch.setattr(sys, "argv", [f"{name}.py", *map(str, words)])
    return module.main()


def show(robot):
    """Leads the arm once it is limp, and presses the chest button."""
    while not robot.do(limp, ARM):
        time.sleep(0.02)
    begin = time.monotonic()
    while (t := time.monotonic() - begin) < SECONDS + 0.3:
        s = min(t / SECONDS, 1.0)
        joints = START + (END - START) * (10 * s**3 - 15 * s**4 + 6 * s**5)
        robot.do(lead, dict(zip(ARM, joints.tolist(), strict=True)))
        time.sleep(0.005)
    robot.do(press_chest)


def test_what_is_shown_is_learned_and_performed(tmp_path, monkeypatch):
    shown, primitive = tmp_path / "shown", tmp_path / "learned" / "primitive.yaml"
    with served_apart() as robot:
        to = ("--station", "naoqi", "--robot", robot.address, "--link", "wire", "--disable-life")
        person = threading.Thread(target=show, args=(robot,))
        person.start()
        assert app("record", monkeypatch, *to, "--output", shown) == 0
        person.join(10)
        goal = robot.do(right_hand)
        assert app("learn", monkeypatch, shown, "--output", primitive.parent) == 0
        robot.do(stand)
        options = ("--primitive", primitive, "--unattended", "--hold-at-end")
        code = app("reproduce", monkeypatch, *to, *options, "--output", tmp_path / "performed")
        hand = robot.do(right_hand)
    report = json.loads((tmp_path / "performed" / "report.json").read_text())
    assert code == 0, report
    assert report["outcome"] == "reached"
    assert report["fault"] == ""
    # It ends where the person had led it.
    np.testing.assert_allclose(hand, goal, atol=0.005)
    log = np.load(tmp_path / "performed" / "log.npz")
    np.testing.assert_allclose(hand, log["goal_position_torso_m"], atol=0.005)
