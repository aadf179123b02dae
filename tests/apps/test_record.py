import json
import subprocess
import sys
from pathlib import Path

import pytest

from pepper_drake.learning import Demonstration

APP = Path(__file__).parents[2] / "apps" / "record.py"


def run(*arguments):
    return subprocess.run(
        [sys.executable, str(APP), *map(str, arguments)], capture_output=True, text=True
    )


def test_records_the_left_arm_into_a_folder(tmp_path):
    result = run("--arm", "left", "--output", tmp_path)
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("recorded: ")
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["outcome"] == "recorded"
    assert report["final_guide_distance"] < 0.002
    demo = Demonstration.load(tmp_path)
    assert demo.joint_names[0] == "LShoulderPitch"
    assert demo.positions[-1][1] > 0.15
    assert "meshcat" in (tmp_path / "recording.html").read_text().lower()


def test_an_unreachable_guide_is_a_failure_with_a_reason(tmp_path):
    script = tmp_path / "far.yaml"
    script.write_text(
        "via_points:\n"
        "- {time: 0.5, position: [0.3, -0.3, 0.0], rpy: [0, 0, 0]}\n"
        "- {time: 1.0, position: [0.9, -0.3, 0.0], rpy: [0, 0, 0]}\n"
    )
    result = run("--guide", script, "--output", tmp_path / "out", "--quiet")
    assert result.returncode == 1
    assert result.stdout == ""
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert "did not follow" in report["reason"]


@pytest.mark.parametrize("guide", ["nowhere.yaml", "jump"])
def test_bad_input_is_one_sentence_and_exit_code_2(tmp_path, guide):
    result = run("--guide", guide, "--output", tmp_path)
    assert result.returncode == 2
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1
