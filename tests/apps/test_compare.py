import json
import runpy
import sys
from pathlib import Path

import pytest

from pepper_drake.learning.demonstrations.synthetic import example_demonstrations

APP = Path(__file__).parents[2] / "apps" / "compare.py"


def run_app(monkeypatch, *arguments):
    """Returns the app's exit code."""
    monkeypatch.setattr(sys, "argv", [str(APP), *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        runpy.run_path(str(APP), run_name="__main__")
    return stopped.value.code


def test_writes_table_and_figure_of_a_folder(monkeypatch, tmp_path, capsys):
    for demonstration in example_demonstrations(2):
        demonstration.save(tmp_path / "demos" / f"{demonstration.name}.txt")
    out = tmp_path / "out"
    code = run_app(
        monkeypatch,
        tmp_path / "demos",
        *("--approximators", "lwr", "gmr"),
        *("--num-basis", "10", "20"),
        *("--output", out, "--quiet"),
    )
    assert code == 0
    assert capsys.readouterr().out == ""
    table = json.loads((out / "table.json").read_text())
    assert len(table["rows"]) == 4
    assert set(table["rows"][0]) == {
        "approximator",
        "num_basis",
        "demonstrations",
        "position_distance",
        "velocity_distance",
        "position_distance_median",
        "velocity_distance_median",
        "fit_seconds",
        "rollout_seconds",
    }
    assert table["rows"][3]["approximator"] == "gmr"
    assert table["rows"][3]["num_basis"] == 20
    assert "| lwr | 10 |" in (out / "table.md").read_text()
    assert (out / "comparison.png").stat().st_size > 10_000


def test_takes_made_up_motions_where_none_are_given(monkeypatch, tmp_path, capsys):
    code = run_app(monkeypatch, "--approximators", "lwr", "--num-basis", "10", "--output", tmp_path)
    assert code == 0
    assert "on 10 demonstrations" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--approximators", "magic"], "'magic' is unknown"),
        (["--num-basis", "0"], "--num-basis: 0"),
        (["nowhere"], "nowhere"),
    ],
)
def test_bad_input_is_one_sentence_and_exit_code_2(
    monkeypatch, tmp_path, capsys, arguments, complaint
):
    code = run_app(monkeypatch, *arguments, "--output", tmp_path)
    error = capsys.readouterr().err
    assert code == 2
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert complaint in error


def test_an_output_that_cannot_be_written_is_said_before_the_work(monkeypatch, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    code = run_app(monkeypatch, "--output", tmp_path / "file")
    assert code == 2
    assert "--output" in capsys.readouterr().err
