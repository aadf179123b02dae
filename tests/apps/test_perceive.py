import importlib.util
import json
import math
import sys
from pathlib import Path

import pytest

from pepper_drake import cli
from pepper_drake.evaluation.perception_evaluation import GoalSample

APP = Path(__file__).parents[2] / "apps" / "perceive.py"


@pytest.fixture
def app(monkeypatch):
    """The app as a module, which leaves the tests' standard output alone."""
    spec = importlib.util.spec_from_file_location("perceive_app", APP)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(cli, "quiet_libraries", lambda: None)
    return module


def run(app, monkeypatch, capsys, *arguments):
    """Runs the app in this process: exit code, standard output, standard error."""
    monkeypatch.setattr(sys, "argv", ["perceive.py", *map(str, arguments)])
    with pytest.raises(SystemExit) as exit_info:
        cli.run(app.main)
    captured = capsys.readouterr()
    return exit_info.value.code, captured.out, captured.err


@pytest.mark.render
def test_it_leaves_a_report_figures_and_a_page(app, monkeypatch, capsys, tmp_path):
    monkeypatch.setattr(app, "_DISTANCES", (0.4, 0.8))
    options = ["--output", tmp_path, "--samples", 1, "--frames", 2, "--seed", 3]
    options += ["--wrong-goal-frames", 3, "--poses", 1]
    code, out, err = run(app, monkeypatch, capsys, *options)
    assert code == 0
    assert "depth" in out
    assert "stereo" in out
    assert "goal" in out
    assert "Traceback" not in err
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["depth"].pop("over_poses") == {"poses": 1, "robot_points": 0, "goal_points": 0}
    for name in ("depth", "stereo"):
        assert set(report[name]) == {
            "points",
            "rms_error",
            "bias",
            "coverage",
            "outlier_share",
            "robot_points",
            "goal_points",
            "milliseconds",
        }
        assert set(report[name]["bias"]) == {"x", "y", "z"}
    goal = report["goal"]
    assert {"position_error", "orientation_error", "detection_rate", "milliseconds"} <= set(goal)
    assert len(goal["by_distance_and_camera"]) == 4
    assert goal["wrong_goals"] == {"frames": 3, "measured": 0, "wrong": 0}
    assert report["seed"] == 3
    for name in ("images.png", "clouds.png", "goal.png"):
        assert (tmp_path / name).stat().st_size > 5_000
    page = (tmp_path / "clouds.html").read_text()
    assert "meshcat" in page.lower()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--scene", "nowhere"), "nowhere"),
        (("--samples", "0"), "at least 1"),
        (("--poses", "-1"), "negative"),
        (("--texture", "wool"), "wool"),
        (("--frames", "many"), "many"),
    ],
)
def test_bad_input_is_one_sentence_and_code_2(
    app, monkeypatch, capsys, tmp_path, arguments, message
):
    code, _, err = run(app, monkeypatch, capsys, "--output", tmp_path / "out", *arguments)
    assert code == 2
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert not (tmp_path / "out").exists()


def test_a_marker_that_was_never_found_is_said_so(app):
    sample = GoalSample("CameraTop", 0.5, 0.1, False, math.nan, math.nan, 4.0)
    report = app.make_report({}, [sample])
    assert report["goal"]["detection_rate"] == 0
    assert report["goal"]["position_error"]["median"] is None
    json.dumps(report, allow_nan=False)
    cloud = {"points": 0, "rms_error": 0.0, "bias": {"x": 0.0}, "coverage": 0.0}
    cloud |= {"outlier_share": 0.0, "milliseconds": 1.0}
    assert "never found" in app.summary(report | {"depth": cloud, "stereo": cloud})
