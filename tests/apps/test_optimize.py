import json
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from pepper_drake.diagrams.factory import SHIPPED_DEMONSTRATION
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.demonstrations.synthetic import example_demonstrations
from pepper_drake.optimization import History

APP = Path(__file__).parents[2] / "apps" / "optimize.py"
AWAY = ("--goal-offset", "0.06", "0.06", "0.05")


def run_app(monkeypatch, *arguments):
    """Returns the app's exit code."""
    monkeypatch.setattr(sys, "argv", [str(APP), *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        runpy.run_path(str(APP), run_name="__main__")
    return stopped.value.code


@pytest.fixture(scope="module")
def motion(tmp_path_factory):
    path = tmp_path_factory.mktemp("motion") / "motion.txt"
    example_demonstrations(1)[0].save(path)
    return path


@pytest.fixture
def plain_figures(monkeypatch):
    """Empty figures, where a test is about something else."""
    for name in ("draw_costs", "draw_ways"):
        monkeypatch.setattr(
            f"pepper_drake.reporting.optimization_report.{name}", lambda *_, **__: Figure()
        )
    monkeypatch.setattr(
        "pepper_drake.reporting.optimization_figures.draw_reproductions", lambda *_, **__: Figure()
    )


def test_the_reports_run(monkeypatch, tmp_path, capsys, motion):
    monkeypatch.setattr("pepper_drake.cli.shows_progress", lambda options: True)
    assert run_app(monkeypatch, motion, *AWAY, "--output", tmp_path) == 0
    said = capsys.readouterr()
    assert "cost 0.09849 before" in said.out
    assert "70/70" in said.err  # The progress bar.
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["updates"] == 7
    assert report["rollouts"] == 70
    assert report["costs"][0] == pytest.approx(0.0985, abs=1e-4)
    assert report["costs"][-1] < 0.035  # The report's figure 4.7.
    assert report["best_terms"]["hand_to_goal"] == pytest.approx(report["best_cost"])
    found = MovementPrimitive.load(tmp_path / "primitive.yaml")
    goal = Demonstration.load(motion).positions[-1] + [0.06, 0.06, 0.05]
    error = np.linalg.norm(found.rollout().positions[-1] - goal)
    assert error == pytest.approx(report["best_cost"], abs=1e-6)
    for name in ("cost.png", "paths.png"):
        assert (tmp_path / name).stat().st_size > 10_000


@pytest.mark.usefixtures("plain_figures")
def test_interrupted_and_resumed(monkeypatch, tmp_path, capsys, motion):
    from pepper_drake.optimization.fast_rollouts import FastRollouts

    options = (motion, *AWAY, "--kernels", "2", "--method", "cmaes", "--quiet", "--output")
    assert run_app(monkeypatch, *options, tmp_path / "whole") == 0
    performed, calls = FastRollouts.__call__, []

    def interrupted(self, samples):
        calls.append(1)
        if len(calls) == 8:
            raise KeyboardInterrupt
        return performed(self, samples)

    with monkeypatch.context() as patch:
        patch.setattr(FastRollouts, "__call__", interrupted)
        assert run_app(patch, *options, tmp_path / "parts") == 130
    message = capsys.readouterr().err
    assert "interrupted after 3 of 7 updates; run the same command with --resume" in message
    assert json.loads((tmp_path / "parts" / "report.json").read_text())["updates"] == 3
    assert run_app(monkeypatch, *options, tmp_path / "parts", "--resume") == 0
    whole, parts = (History.load(tmp_path / name / "history.npz") for name in ("whole", "parts"))
    assert parts.mean_costs == whole.mean_costs
    assert np.array_equal(parts.means, whole.means)
    assert run_app(monkeypatch, *options, tmp_path / "parts", "--resume", "--seed", "1") == 2
    assert "--resume: seed was 0 and is 1 now" in capsys.readouterr().err


@pytest.mark.usefixtures("plain_figures")
def test_around_obstacles_from_a_primitive(monkeypatch, tmp_path, motion):
    primitive = MovementPrimitive.fit(Demonstration.load(motion))
    primitive.save(tmp_path / "primitive.yaml")
    middle = primitive.rollout().positions[150]
    np.savetxt(tmp_path / "cloud.txt", middle + [[0.0, 0.0, -0.03], [0.01, 0.0, -0.03]])
    code = run_app(
        monkeypatch,
        *(tmp_path / "primitive.yaml", "--obstacles", tmp_path / "cloud.txt"),
        *("--method", "cmaes", "--kernels", "5", "--fixed-end", "--updates", "25"),
        *("--output", tmp_path / "out", "--quiet"),
    )
    assert code == 0
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["parameters"] == 15
    assert report["best_terms"]["hand_to_obstacles"] < 0.001
    assert report["best_terms"]["hand_to_goal"] < 0.005
    assert report["costs"][0] > 0.3


@pytest.mark.usefixtures("plain_figures")
def test_a_tutor_types_scores(monkeypatch, tmp_path, motion):
    questions = []
    monkeypatch.setattr("builtins.input", lambda text: questions.append(text) or "6")
    options = ("--cost", "rating", "--updates", "2", "--samples", "2", "--quiet", "--output")
    assert run_app(monkeypatch, motion, *options, tmp_path) == 0
    assert len(questions) == 4
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["best_cost"] == pytest.approx(0.4)
    assert report["costs"] == [None] * 3
    assert (tmp_path / "ratings.txt").read_text() == "6\n" * 4


@pytest.mark.usefixtures("plain_figures")
def test_a_tutor_writes_scores(monkeypatch, tmp_path, capsys, motion):
    scores = tmp_path / "scores.txt"
    scores.write_text("3\n9\n")
    options = ("--cost", "rating", "--ratings", scores, "--updates", "2", "--samples", "2")
    options = (motion, *options, "--quiet", "--output", tmp_path / "out")
    assert run_app(monkeypatch, *options) == 2
    assert "rate " in (message := capsys.readouterr().err)
    assert "003 to 004" in message
    scores.write_text("3\n9\n1\n2\n")
    assert run_app(monkeypatch, *options, "--resume") == 0
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["best_cost"] == pytest.approx(0.1)
    assert report["rollouts"] == 4


def test_all_methods_compared(monkeypatch, tmp_path, capsys, motion):
    options = ("--compare", "--seeds", "2", "--updates", "3", "--samples", "4", "--kernels", "2")
    assert run_app(monkeypatch, motion, *AWAY, *options, "--output", tmp_path) == 0
    assert "natural" not in (said := capsys.readouterr().out)
    assert all(name in said for name in ("algorithm3", "pi2cma", "cmaes", "power", "enac"))
    table = json.loads((tmp_path / "comparison.json").read_text())
    assert table["rollouts"] == [0, 4, 8, 12]
    assert np.array(table["costs"]["enac"]).shape == (2, 4)
    assert (tmp_path / "comparison.png").stat().st_size > 20_000


@pytest.mark.usefixtures("plain_figures")
def test_the_whole_arm_around_a_table(monkeypatch, tmp_path, capsys):
    x, y = np.meshgrid(np.arange(0.15, 0.6, 0.02), np.arange(-0.7, 0.3, 0.02))
    points = np.column_stack((x.ravel(), y.ravel(), np.full(x.size, -0.08)))
    np.savetxt(tmp_path / "cloud.txt", points)
    code = run_app(
        monkeypatch,
        *(SHIPPED_DEMONSTRATION, "--obstacles", tmp_path / "cloud.txt"),
        *("--rollouts", "kinematics", "--method", "cmaes"),
        *("--samples", "24", "--updates", "40", "--target", "0.02", "--seed", "1"),
        *("--output", tmp_path / "out"),
    )
    assert code == 0
    assert "arm_clearance" in capsys.readouterr().out
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["best_cost"] <= 0.02
    assert report["updates"] < 40
    assert report["parameters"] == 30
    assert report["best_terms"]["arm_clearance"] > 0.018


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([], "--goal: the hand ends at"),
        (["--goal", "300", "-200", "100"], "--goal: 374 m from the torso"),
        (["--updates", "0"], "--updates, --seeds: use at least 1"),
        ([*AWAY, "--jobs", "0"], "jobs: 0; use at least 1"),
        ([*AWAY, "--decay", "2"], "decay: 2.0 is not above 0"),
        ([*AWAY, "--resume"], "there is nothing to resume"),
        ([*AWAY, "--ratings", "x.txt"], "--ratings: the cost has no rating"),
        ([*AWAY, "--cost", "hand_to_obstacles"], "needs obstacles"),
        (["--obstacles", "none.txt"], "none.txt: no such file"),
        (["--cost", "jerk", "--clearance", "-1"], "--clearance: -1.0 m is negative"),
        ([*AWAY, "--scene", "table"], "--scene: is for --rollouts diagram only"),
        ([*AWAY, "--free", "joints"], "it has no joints"),
        (["--rollouts", "kinematics", "--cost", "jerk"], "it has no joints"),
    ],
)
def test_bad_options_are_one_sentence(monkeypatch, tmp_path, capsys, motion, options, words):
    code = run_app(monkeypatch, motion, *options, "--quiet", "--output", tmp_path / "out")
    assert code == 2
    message = capsys.readouterr().err
    assert words in message
    assert message.count("\n") == 1
