import json
from functools import partial
from pathlib import Path

import pytest

from pepper_drake import cli
from pepper_drake.benchmarking.method_result import MethodResult
from tests.apps.conftest import load_app

APP = Path(__file__).parents[2] / "apps" / "benchmark.py"


@pytest.fixture
def run(call_app):
    return partial(call_app, load_app("benchmark"))


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
