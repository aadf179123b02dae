import importlib
import json
import subprocess
import sys
from pathlib import Path

import pytest

from pepper_drake import cli
from pepper_drake.learning import Demonstration, MovementPrimitive

APP = Path(__file__).parents[2] / "apps" / "teach.py"


def test_the_whole_story_with_the_left_arm(tmp_path):
    """As a user runs it, in a process of its own."""
    arguments = ("--script", "story", "--no-cameras", "--arm", "left", "--output", str(tmp_path))
    result = subprocess.run([sys.executable, str(APP), *arguments], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    for words in ("Recorded ", "Learned ", "At the goal", "Saved "):
        assert words in result.stdout
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["outcome"] == "done"
    assert report["mode"] == "holding"
    assert report["goal_distance"] < 0.01
    assert report["frames_per_second"] > 0
    assert report["realtime_rate"] > 0
    demonstration = Demonstration.load(tmp_path / "demonstration")
    assert demonstration.joint_names[0] == "LShoulderPitch"
    primitive = MovementPrimitive.load(tmp_path / "primitive.yaml")
    assert primitive.posture is not None


def test_a_script_that_waits_in_vain_is_the_robots_failure(run_app, tmp_path):
    script = tmp_path / "vain.yaml"
    script.write_text("steps:\n- {press: Reach}\n- {until: holding, wait: 0.1}\n")
    result = run_app("teach", "--script", script, "--no-cameras", "--output", tmp_path)
    assert result.returncode == 1
    assert "Traceback" not in result.stderr
    assert "waited 0.1 s for Pepper to be holding" in result.stderr
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["outcome"] == "failed"
    assert "nothing to perform" in report["reason"]


def test_a_live_page_for_some_time_tells_its_address_and_its_pace(run_app, tmp_path):
    result = run_app("teach", "--seconds", "0.5", "--no-cameras", "--output", tmp_path)
    assert result.returncode == 0, result.stderr
    assert "Open http://" in result.stdout
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["simulated_seconds"] == pytest.approx(0.5, abs=0.04)


def test_what_cannot_be_moved_is_bad_input_in_one_sentence(run_app, tmp_path):
    result = run_app("teach", "--move", "spoon", "--no-cameras", "--output", tmp_path)
    assert result.returncode == 2
    assert '"spoon"' in result.stderr
    assert "Traceback" not in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--script", "nothing.yaml"], "nothing.yaml is neither a script"),
        (["--seconds", "-1"], '"-1" is not a time'),
        (["--seconds", "soon"], '"soon" is not a time'),
    ],
)
def test_bad_arguments_are_told_before_anything_is_built(monkeypatch, capsys, arguments, words):
    monkeypatch.syspath_prepend(str(APP.parent))
    monkeypatch.setattr(sys, "argv", ["teach.py", *arguments])
    main = importlib.import_module("teach").main
    with pytest.raises(SystemExit) as end:
        cli.run(main)
    assert end.value.code == cli.EXIT_BAD_INPUT
    assert words in capsys.readouterr().err


def test_a_lesson_about_an_obstacle_needs_eyes(run_app, tmp_path):
    result = run_app("teach", "--lesson", "first", "--no-cameras", "--output", tmp_path)
    assert result.returncode == 2
    assert "in the lesson first Pepper has to see" in result.stderr
