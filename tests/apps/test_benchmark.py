import json
import sys
from functools import partial
from html.parser import HTMLParser
from pathlib import Path

import pytest

from pepper_drake import cli
from pepper_drake.benchmarking.baseline import HIGHER, LOWER, Metric
from pepper_drake.benchmarking.batch import Task
from pepper_drake.benchmarking.case import Case
from pepper_drake.benchmarking.diagram_reach import DiagramReach
from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.benchmarking.planned_reach import PlannedReach
from pepper_drake.reporting.benchmark_report import record_failures, replay_folder, save_benchmark
from tests.apps.conftest import load_app

APP = Path(__file__).parents[2] / "apps" / "benchmark.py"


@pytest.fixture(scope="module")
def app():
    return load_app("benchmark")


@pytest.fixture
def run(app, call_app):
    return partial(call_app, app)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--methods", "a,q"), ('"q"', "a (demonstration as it is)")),
        (("--methods", ""), ('""', "a (")),
        (("--scenes", "0"), ("0", "at least 1")),
        (("--scenes", "few"), ('"few"', "whole number")),
        (("--scene", "nowhere"), ("nowhere", "table, shelf")),
        (("--scene", "table", "--moving"), ("--moving", "random")),
        (("--goal-motion", "sideways"), ('"sideways"', "up, aside, away")),
        (("--jobs", "-1"), ('"-1"',)),
        (("--family", "bin,house"), ('"house"', "bin, compartment")),
        (("--family", "bin", "--scene", "table"), ("--family", "--scene")),
        (("--family", "compartment", "--moving"), ("compartment", "--moving")),
        (("--family", "all", "--replay", "d:3"), ("--replay", "one name")),
        (("--methods", "nowhere.py:plan"), ("nowhere.py", "no such file")),
        (("--replay", "d"), ('"d"', "d:17")),
        (("--replay", "q:3"), ('"q"',)),
    ],
)
def test_a_bad_option_is_one_sentence(arguments, words, run, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, output, error = run(*arguments)
    assert (code, output) == (cli.EXIT_BAD_INPUT, "")
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    for word in words:
        assert word in error, error
    assert list(tmp_path.iterdir()) == []


def test_a_benchmark_leaves_table_numbers_and_plots_and_goes_on_where_it_was(run, tmp_path):
    # One scene is there already; the other is run, in a process of its own.
    MethodResult("free_seed_0", "g", "touched", message="a link touched").save(
        tmp_path / "results" / "free_seed_0" / "g.json"
    )
    options = ("--scene", "free", "--scenes", 2, "--methods", "g", "--output", tmp_path)
    code, printed, error = run(*options)
    assert (code, error) == (cli.EXIT_DONE, "")
    assert "g: trajectory optimisation" in printed
    assert "1 of 2 scenes can be solved" in printed
    result = MethodResult.load(tmp_path / "results" / "free_seed_1" / "g.json")
    assert result.outcome == "reached"
    content = json.loads((tmp_path / "benchmark.json").read_text())
    assert content["solvable"] == ["free_seed_1"]
    assert content["not_reached"]["g"] == {"free_seed_0": "touched: a link touched"}
    assert content["methods"][0]["rates"]["reached"] == {"count": 1, "total": 1}
    assert "| g: trajectory" in (tmp_path / "benchmark.md").read_text()
    assert (tmp_path / "benchmark.png").read_bytes().startswith(b"\x89PNG")
    written = (tmp_path / "results" / "free_seed_1" / "g.json").stat().st_mtime_ns
    assert run(*options)[0] == cli.EXIT_DONE
    assert (tmp_path / "results" / "free_seed_1" / "g.json").stat().st_mtime_ns == written


class Page(HTMLParser):
    """Collects what a page refers to, and its text."""

    def __init__(self, text):
        super().__init__()
        self.addresses, self.words = [], ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.addresses += [value for name, value in attributes if name in ("src", "href")]

    def handle_data(self, data):
        self.words += data


def test_the_page_needs_no_network_and_says_what_failed(tmp_path):
    tasks = [Task(letter, Case(0, "free")) for letter in "dg"]
    results = [
        MethodResult("free_seed_0", "d", "touched", message="<b>a link</b> touched"),
        MethodResult("free_seed_0", "g", "reached", jerk=3.0),
    ]
    recording = replay_folder(tmp_path, tasks[0]) / "recording.html"
    recording.parent.mkdir(parents=True)
    recording.write_text("seen")
    save_benchmark(tasks, results, tmp_path)
    numbers = (tmp_path / "benchmark.json").read_text()
    assert "NaN" not in numbers  # Which no other reader of JSON takes.
    assert json.loads(numbers)["methods"][0]["medians"]["jerk"] is None
    page = Page((tmp_path / "benchmark.html").read_text())
    links = [address for address in page.addresses if not address.startswith("data:image/png")]
    assert links == ["replay/free_seed_0_d/recording.html"]
    assert (tmp_path / links[0]).read_text() == "seen"
    assert len(page.addresses) == 3  # The figure, the scene's picture, the recording.
    assert "<b>a link</b> touched" in page.words
    assert "1 of 2 runs" in page.words
    scene = json.loads((tmp_path / "scenes" / "free_seed_0.json").read_text())
    assert scene["format"] == "pepper arena scene"


def test_what_has_moved_nothing_has_no_recording(tmp_path, monkeypatch):
    recorded = []
    monkeypatch.setattr(PlannedReach, "replay", lambda self, case, folder: recorded.append(folder))
    monkeypatch.setattr(DiagramReach, "replay", lambda self, case, folder: recorded.append(folder))
    tasks = [Task(letter, Case(0)) for letter in "abcfg"]
    results = [
        MethodResult("random_0", letter, outcome)
        for letter, outcome in zip(
            "abcfg", ("reached", "touched", "refused", "refused", "error"), strict=True
        )
    ]
    record_failures(tasks, results, tmp_path)
    assert [folder.name for folder in recorded] == ["random_0_b", "random_0_c"]


@pytest.mark.parametrize(
    ("options", "names"),
    [
        (("--scenes", "1", "--seed", "3"), ["random_3"]),
        (
            ("--scenes", "2", "--family", "table,bin"),
            ["random_0", "bin_0", "random_1", "bin_1"],
        ),
        (
            ("--scenes", "1", "--family", "compartment,bin", "--moving", "--sensors", "ideal"),
            ["moving_bin_0_ideal_sensors"],
        ),
    ],
)
def test_families_are_drawn_side_by_side(options, names, app, monkeypatch, tmp_path):
    monkeypatch.setattr(
        sys,
        "argv",
        ["benchmark.py", "--methods", "a,c", "--output", str(tmp_path), *options],
    )
    tasks = app.make_tasks(cli.parse(app.make_parser()))
    assert [task.case.name for task in tasks if task.method == "a"] == names


MEASURED = {
    "still.reached of 4": Metric(4, "1", HIGHER, 0.0),
    "reach.median jerk": Metric(6.0, "m/s³", LOWER, 1.0),
}


def test_the_gate_fails_with_a_line_for_each_metric_that_is_worse(run, app, tmp_path, monkeypatch):
    file = tmp_path / "baseline.json"
    options = ("--baseline", file, "--output", tmp_path / "out")
    monkeypatch.setattr(app, "measure_gate", lambda *args, **kwargs: MEASURED)
    code, _, error = run("--gate", *options)
    assert code == cli.EXIT_BAD_INPUT
    assert "there is no baseline" in error
    code, _, error = run("--update-baseline", " ", *options)
    assert code == cli.EXIT_BAD_INPUT
    assert "no reason" in error
    assert run("--update-baseline", "the first", *options)[0] == cli.EXIT_DONE
    assert json.loads(file.read_text())["reason"] == "the first"
    code, output, error = run("--gate", *options)
    assert (code, error) == (cli.EXIT_DONE, "")
    assert "reach.median jerk: 6 m/s³" in output
    worse = {
        "still.reached of 4": Metric(3, "1", HIGHER, 0.0),
        "reach.median jerk": Metric(7.5, "m/s³", LOWER, 1.0),
    }
    monkeypatch.setattr(app, "measure_gate", lambda *args, **kwargs: worse)
    code, _, error = run("--gate", *options)
    assert code == cli.EXIT_FAILED
    assert [line.split(":")[1].strip() for line in error.splitlines()] == list(worse)
