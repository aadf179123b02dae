import itertools
import json
import os
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from functools import partial
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from pepper_drake import cli, scenario
from pepper_drake.benchmarking.methods import get_method
from pepper_drake.diagrams.factory import make_coupling
from pepper_drake.diagrams.reach_result import save_result
from pepper_drake.diagrams.reach_simulation import ReachSimulation
from pepper_drake.models.scene import load_scene, save_scene
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.results.reach_log import ReachLog
from tests.apps.conftest import load_app

APP = Path(__file__).parents[2] / "apps" / "reach.py"
FREE = """\
name: stand
arm: right
goal:
  position: [0.95, -0.12, 0.78]
obstacles:
- name: tray
  shape: box
  size: [0.12, 0.12, 0.015]
  position: [0.95, -0.12, 0.7725]
"""


@pytest.fixture
def app():
    return load_app("reach")


@pytest.fixture
def run(app, call_app):
    return partial(call_app, app)


def rows(count=30):
    """A motion of ten columns along x."""
    times = np.arange(count) / 100
    table = np.zeros((count, 10))
    table[:, 0], table[:, 1] = times, 0.1 * times
    return [list(row) for row in table]


def write_rows(path, table):
    path.write_text("".join(" ".join(map(str, row)) + "\n" for row in table))
    return path


def changed(row, column, value):
    table = rows()
    table[row][column] = value
    return table


BAD_SCENES = {
    "typo": (FREE.replace("arm:", "amr:"), ("line 2", '"amr"', "arm")),
    "text for a number": (FREE.replace("0.95,", "far,", 1), ("line 4", '"far"', "number")),
    "not a number": (FREE.replace("0.95,", ".nan,", 1), ("line 4", "finite")),
    "inside the table": (FREE.replace("0.78]", "0.77]"), ("line 4", '"tray"', "move")),
    "no yaml": (FREE.replace("0.78]", "0.78"), ("line", "not valid YAML")),
    "arm": (FREE.replace("right", "middle"), ("line 2", '"middle"', "left")),
    "posture": (FREE + "robot: {posture: sit}\n", ("line 10", '"sit"', "stand")),
    "empty": ("", ("empty", "fields")),
}


@pytest.mark.parametrize("name", BAD_SCENES)
def test_a_bad_scene_is_one_sentence_with_file_line_and_mend(name, run, tmp_path):
    text, words = BAD_SCENES[name]
    file = tmp_path / "scene.yaml"
    file.write_text(text)
    check_refused(run("--scene", file, "--output", tmp_path / "out"), "scene.yaml", *words)
    assert not (tmp_path / "out").exists()


BAD_DEMONSTRATIONS = {
    "nine columns": ([row[:9] for row in rows()], ("line 1", "9 columns", "10")),
    "time runs backwards": (changed(20, 0, 0.05), ("line 21", "0.05", "order")),
    "not a number": (changed(7, 4, "nan"), ("line 8", "nan", "finite")),
    "a text": (changed(7, 4, "here"), ("line 8", "'here'", "number")),
    "nothing": ([], ("0 rows", "at least")),
}


@pytest.mark.parametrize("name", BAD_DEMONSTRATIONS)
def test_a_bad_demonstration_is_one_sentence_with_file_line_and_mend(name, run, tmp_path):
    table, words = BAD_DEMONSTRATIONS[name]
    file = write_rows(tmp_path / "demo.txt", table)
    check_refused(run("--demo", file, "--output", tmp_path / "out"), "demo.txt", *words)


BAD_MOTIONS = {
    "time runs backwards": ([[0, 0, 0, 0], [1, 0, 0, 0.1], [0.5, 0, 0, 0.1]], ("line 3", "time")),
    "three columns": ([[0, 0, 0], [1, 0, 0.1]], ("line 1", "3 columns", "time x y z")),
    "not a number": ([[0, 0, 0, 0], [1, 0, 0, "nan"]], ("line 2", "finite")),
    "one row": ([[0, 0, 0, 0]], ("at least two",)),
}


@pytest.mark.parametrize("name", BAD_MOTIONS)
def test_a_bad_goal_motion_is_one_sentence_with_file_line_and_mend(name, run, tmp_path):
    table, words = BAD_MOTIONS[name]
    file = write_rows(tmp_path / "motion.txt", table)
    check_refused(run("--goal-motion", file, "--output", tmp_path / "out"), "motion.txt", *words)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--scene", "nowhere.yaml"), ("nowhere.yaml", "table, shelf, clutter, free")),
        (("--demo", "nowhere.txt"), ("nowhere.txt", "no such file")),
        (("--demo", "."), ("translation.txt", "no such file")),
        (("--goal-motion", "sideways"), ('"sideways"', "up, aside, away")),
        (("--arm", "middle"), ("'middle'", "left")),
        (("--coupling", "magic"), ("'magic'", "barrier")),
        (("--method", "reactive", "--coupling", "report"), ("--method", "leave --coupling out")),
        (("--method", "adapted", "report", "--goal-motion", "up"), ("several methods", "one")),
        (("--coupling", "nowhere.py:Mine"), ("nowhere.py", "no such file")),
        (("--random-scene", "-3"), ('"-3"', "whole number")),
        (("--seed", "many"), ('"many"', "whole number")),
        (("--scene", "free", "--random-scene", "1"), ("--random-scene", "--scene")),
    ],
)
def test_a_bad_option_is_one_sentence(arguments, words, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    check_refused(run(*arguments), *words)
    assert list(tmp_path.iterdir()) == []


def check_refused(result, *words):
    code, output, error = result
    assert code == cli.EXIT_BAD_INPUT
    assert output == ""
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    for word in words:
        assert word in error, error


def test_as_a_user_runs_it_bad_input_is_one_line_on_standard_error(tmp_path):
    file = tmp_path / "input"
    file.write_text(FREE.replace("arm:", "amr:"))
    command = [sys.executable, str(APP), "--scene", str(file), "--output", str(tmp_path / "out")]
    result = subprocess.run(command, capture_output=True, text=True, env={**os.environ, "TERM": ""})
    check_refused((result.returncode, result.stdout, result.stderr), "input", "line 2", "amr")


@pytest.mark.parametrize(
    ("option", "content", "words"),
    [
        ("--demo", "0 1 2 3 4 5 6 7 8\n" * 5, ("line 1", "9 columns")),
        ("--scene", None, ("neither a scene file", "table")),
    ],
)
def test_a_bad_file_of_any_name_is_one_line_on_standard_error(
    option, content, words, run, tmp_path
):
    file = tmp_path / "input"
    if content is not None:
        file.write_text(content)
    check_refused(run(option, file, "--output", tmp_path / "out"), "input", *words)


@pytest.mark.parametrize("letter", ["a", "b"])
def test_the_options_that_the_benchmark_names_build_what_it_runs(letter, app, monkeypatch):
    method = get_method(letter).run
    monkeypatch.setattr(scenario, "Reaching", lambda *parts: parts)
    chosen = app.chosen_scenario(app.make_parser().parse_args([*method.options]))
    _, _, coupling, config = scenario.build_reaching(chosen)
    assert coupling == make_coupling(method.coupling)
    assert coupling is None or config.planner.collision_checked == method.collision_checked


def check_arm_never_moved(log):
    assert ReachMode.REACHING not in log.mode
    # Head and base may move; the arms, 2..11, rest.
    arms = log.joint_command_rad[:, 2:12]
    np.testing.assert_array_equal(arms, np.broadcast_to(arms[0], arms.shape))
    assert np.ptp(log.joint_position_rad[:, 2:12], axis=0).max() < 2e-3


@pytest.mark.render
def test_a_marker_that_nobody_can_see_is_a_failure_with_a_name(run, tmp_path):
    scene = load_scene("free")
    marker = scene.goal.marker  # Turned to the far side of the object.
    marker.position[0] *= -1
    marker.rpy[2] += np.pi
    save_scene(scene, tmp_path / "turned.yaml")
    output = tmp_path / "out"
    asked = ("--scene", tmp_path / "turned.yaml", "--set", "supervisor.goal_timeout=1.0")
    code, printed, error = run(*asked, "--output", output, "--no-recording")
    assert (code, error) == (cli.EXIT_FAILED, "")
    assert printed.startswith("failed: no marker of the goal object was seen")
    report = json.loads((output / "report.json").read_text())
    assert (report["outcome"], report["reason"]) == ("failed", "goal_not_seen")
    assert report["goal_estimate_error"] is None
    check_arm_never_moved(ReachLog.load(output / "log.npz"))
    for name in ("path.png", "timeline.png", "scene.png"):
        assert (output / name).stat().st_size > 1000


@pytest.mark.render
def test_a_goal_out_of_reach_is_refused_before_the_arm_moves(run, tmp_path):
    scene = load_scene("free")
    scene.obstacles = []
    scene.goal.position[2] = 0.3
    save_scene(scene, tmp_path / "low.yaml")
    output = tmp_path / "out"
    code, _, error = run(
        "--scene", tmp_path / "low.yaml", "--output", output, "--no-recording", "--quiet"
    )
    assert (code, error) == (cli.EXIT_FAILED, "")
    report = json.loads((output / "report.json").read_text())
    assert (report["outcome"], report["reason"]) == ("failed", "out_of_reach")
    log = ReachLog.load(output / "log.npz")
    check_arm_never_moved(log)
    assert np.ptp(log.base_pose_m_m_rad, axis=0).max() < 1e-3


class Pushed(NamedTuple):
    """A whole reach as the app runs it; the hand is pushed on its way."""

    code: int
    printed: str
    error: str
    folder: Path
    run: ReachSimulation


def reach_and_push(folder, *options, delay=0.0, pictures=True):
    """Runs the app; every eighth answer of its planner takes the processor `delay` s longer."""
    runs = []

    class KeptRun(ReachSimulation):
        def __init__(self, *arguments):
            super().__init__(*arguments)
            runs.append(self)
            planner = self.reaching.planner
            for name in (
                "plan_base_placement",
                "look_along_drive",
                "check_reach",
                "remaining_clearance",
                "stale_space",
            ):
                setattr(planner, name, late(getattr(planner, name)))

    answers = itertools.count()

    def late(answer):
        def answer_late(*question):
            until = time.thread_time() + (0.0 if next(answers) % 8 else delay)
            while time.thread_time() < until:
                pass
            return answer(*question)

        return answer_late

    with (
        pytest.MonkeyPatch.context() as patch,
        redirect_stdout(StringIO()) as printed,
        redirect_stderr(StringIO()) as error,
    ):
        module = load_app("reach")
        patch.setattr(cli, "quiet_libraries", lambda: None)
        patch.setattr(module, "ReachSimulation", KeptRun)
        if not pictures:
            patch.setattr(module, "save", lambda result, *others: save_result(result, others[-1]))
        arguments = ("--scene", "free", "--push", "0", "0", "5", "--output", str(folder), *options)
        patch.setattr(sys, "argv", ["reach.py", *arguments])
        with pytest.raises(SystemExit) as end:
            cli.run(module.main)
    return Pushed(end.value.code, printed.getvalue(), error.getvalue(), folder, *runs)


@pytest.fixture(scope="module")
def pushed(tmp_path_factory):
    return reach_and_push(tmp_path_factory.mktemp("pushed"))


@pytest.mark.render
def test_the_same_seed_gives_the_same_bytes_although_planning_is_late(pushed, tmp_path):
    other = reach_and_push(tmp_path, "--no-recording", delay=0.05, pictures=False)
    answers = other.run.reaching.timed_planner.log
    assert np.count_nonzero([one.seconds >= 0.05 for one in answers]) >= len(answers) // 8
    log, again = (ReachLog.load(one.folder / "log.npz") for one in (pushed, other))
    assert log.mode.tobytes() == again.mode.tobytes()
    assert log.joint_command_rad.tobytes() == again.joint_command_rad.tobytes()


@pytest.mark.render
def test_a_whole_reach_leaves_a_folder_of_results(pushed):
    tmp_path = pushed.folder
    assert (pushed.code, pushed.error) == (cli.EXIT_DONE, "")
    assert pushed.printed.startswith("reached\n")
    assert str(tmp_path) in pushed.printed
    report = json.loads((tmp_path / "report.json").read_text())
    assert (report["outcome"], report["reason"]) == ("reached", "")
    assert report["final_position_error"] <= 0.010
    assert report["goal_estimate_error"] <= 0.010
    assert report["contacts"] == 0
    assert report["minimum_clearance"] > 0
    assert report["cloud"]["points"] > 50
    assert report["cloud"]["robot_points"] == report["cloud"]["goal_points"] == 0
    expected = {
        *("outcome", "reason", "final_position_error", "final_orientation_error"),
        *("minimum_clearance", "contacts", "tracking_error_rms", "goal_estimate_error"),
        *("cloud", "simulated_seconds", "wall_seconds", "realtime_factor", "seed"),
    }
    assert expected <= set(report)
    log = ReachLog.load(tmp_path / "log.npz")
    assert log.time_s[-1] == pytest.approx(report["simulated_seconds"], abs=0.011)
    assert log.goal_distance_m[-1] == pytest.approx(report["final_position_error"], abs=1e-4)
    modes = [m for k, m in enumerate(log.mode) if k == 0 or m != log.mode[k - 1]]
    assert modes == list(ReachMode)[: ReachMode.DONE + 1]
    page = (tmp_path / "recording.html").read_text()
    assert "meshcat" in page.lower()
    assert 'src="http' not in page, "the page opens without a network"
    for name in ("path.png", "timeline.png", "scene.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


@pytest.mark.render
def test_a_reach_that_is_pushed_comes_to_its_goal_all_the_same(pushed):
    report = json.loads((pushed.folder / "report.json").read_text())
    assert (report["outcome"], report["reason"], report["contacts"]) == ("reached", "", 0)
    assert report["final_position_error"] < 0.01
    reaching, context = pushed.run.reaching, pushed.run.simulator.get_context()
    push = reaching.logs["push"].FindLog(context).data().T
    log = ReachLog.load(pushed.folder / "log.npz")
    pushing = push[:, 5] > 0.0
    assert np.count_nonzero(pushing) == pytest.approx(50, abs=1)
    deviation = log.hand_position_torso_m - log.desired_position_torso_m
    assert np.linalg.norm(deviation[pushing], axis=1).max() > 0.015
    # The phase falls more slowly while the hand is pushed than just before.
    rates = -np.diff(np.log(log.phase)) / np.diff(log.time_s)
    start = int(np.argmax(pushing))
    assert rates[start + 30 : start + 50].mean() < 0.8 * rates[start - 20 : start].mean()
