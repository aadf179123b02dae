import json

import numpy as np

from pepper_drake.diagrams.factory import SHIPPED_DEMONSTRATION
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.scenario import Scenario, load_scenario


def test_a_push_is_survived_learned_and_rated(run_app, tmp_path):
    scores = tmp_path / "scores.txt"
    scores.write_text("3\n")
    output = tmp_path / "out"
    push = ("--push", 0, 0, 5, "--learn-corrections", "--score", 7.5, "--scores", scores)
    result = run_app("reproduce", *push, "--output", output)
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("reached: ")
    report = json.loads((output / "report.json").read_text())
    assert report["final_position_error"] < 0.01
    assert report["correction"] > 0.03
    assert load_scenario(output / "scenario.yaml") == Scenario()
    assert scores.read_text() == "3\n7.5\n"
    corrected = MovementPrimitive.load(output / "corrected.yaml")
    assert corrected.name.endswith("corrected")
    assert Demonstration.load(output / "corrected").joints is not None
    log = np.load(output / "log.npz")
    assert log["hand_position_torso_m"].shape == (len(log["time_s"]), 3)


def test_an_unreachable_goal_is_a_failure_with_a_reason(run_app, tmp_path):
    shown = Demonstration.load(SHIPPED_DEMONSTRATION)
    hasty = Demonstration.from_positions(
        0.2 * shown.times,
        shown.positions,
        rotations=shown.rotations,
        joints=shown.joints,
        joint_names=shown.joint_names,
    )
    hasty.save(tmp_path / "demo")
    goal = ("--goal", 0.6, -0.3, 0, "--demo", tmp_path / "demo")
    result = run_app("reproduce", *goal, "--output", tmp_path, "--quiet")
    assert result.returncode == 1
    assert result.stdout == ""
    assert json.loads((tmp_path / "report.json").read_text())["reason"] == "not_reached"


def test_bad_input_is_one_sentence_and_exit_code_2(run_app, tmp_path):
    result = run_app("reproduce", "--score", "11", "--output", tmp_path)
    assert result.returncode == 2
    assert result.stderr == "error: --score 11 must be from 0 to 10\n"
    result = run_app("reproduce", "--goal", 300, -200, 100, "--output", tmp_path)
    assert result.returncode == 2
    assert result.stderr.startswith("error: --goal: 374 m from the torso")
