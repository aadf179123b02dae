import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from pepper_drake.learning import Demonstration

APP = Path(__file__).parents[2] / "apps" / "record.py"


def test_records_the_left_arm_into_a_folder(run_app, tmp_path):
    result = run_app("record", "--arm", "left", "--output", tmp_path)
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("recorded: ")
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["outcome"] == "recorded"
    assert report["final_guide_distance"] < 0.002
    demo = Demonstration.load(tmp_path)
    assert demo.joint_names[0] == "LShoulderPitch"
    assert demo.positions[-1][1] > 0.15
    assert "meshcat" in (tmp_path / "recording.html").read_text().lower()


def test_an_unreachable_guide_is_a_failure_with_a_reason(run_app, tmp_path):
    script = tmp_path / "far.yaml"
    script.write_text(
        "via_points:\n"
        "- {time: 0.5, position: [0.3, -0.3, 0.0], rpy: [0, 0, 0]}\n"
        "- {time: 1.0, position: [0.9, -0.3, 0.0], rpy: [0, 0, 0]}\n"
    )
    result = run_app("record", "--guide", script, "--output", tmp_path / "out", "--quiet")
    assert result.returncode == 1
    assert result.stdout == ""
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert "did not follow" in report["reason"]


@pytest.mark.parametrize("guide", ["nowhere.yaml", "jump"])
def test_bad_input_is_one_sentence_and_exit_code_2(run_app, tmp_path, guide):
    result = run_app("record", "--guide", guide, "--output", tmp_path)
    assert result.returncode == 2
    assert result.stderr.startswith("error: ")
    assert result.stderr.count("\n") == 1


def start_long_recording(folder):
    """Starts recording a minute of the hand going to and fro; returns when it is under way."""
    lines = [
        f"- {{time: {k + 1}, position: [0.1, {-0.2 - 0.1 * (k % 2)}, -0.2], rpy: [0, 0.9, 0]}}"
        for k in range(60)
    ]
    folder.mkdir()
    script = folder / "long.yaml"
    script.write_text("via_points:\n" + "\n".join(lines) + "\n")
    process = subprocess.Popen(
        [sys.executable, str(APP), "--guide", str(script), "--output", str(folder)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    partial = folder / "recording.partial.csv"
    while not partial.exists() or partial.read_bytes().count(b"\n") < 200:
        assert process.poll() is None
        time.sleep(0.02)
    return process


def test_a_killed_recording_is_readable_and_can_be_recovered(run_app, tmp_path):
    folder = tmp_path / "demo"
    process = start_long_recording(folder)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    found = Demonstration.load(folder)
    assert found.times[-1] > 1.9
    np.testing.assert_allclose(np.diff(found.times), 0.01, atol=1e-9)
    result = run_app("record", "--recover", folder)
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith("recovered: ")
    assert not (folder / "recording.partial.csv").exists()
    recovered = Demonstration.load(folder)
    assert recovered.duration > 1.0
    assert recovered.joint_names[0] == "RShoulderPitch"


def test_an_interrupted_recording_ends_in_order(tmp_path):
    folder = tmp_path / "demo"
    process = start_long_recording(folder)
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=30)
    assert process.returncode == 0, errors
    assert output.startswith("stopped: ")
    assert not (folder / "recording.partial.csv").exists()
    assert Demonstration.load(folder).duration > 1.0
    assert json.loads((folder / "report.json").read_text())["stopped_by_user"]
