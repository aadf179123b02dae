import json
import runpy
import sys
from pathlib import Path

import pytest

from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.demonstrations.synthetic import example_demonstrations

APP = Path(__file__).parents[2] / "apps" / "learn.py"


def run_app(monkeypatch, *arguments):
    """Returns the app's exit code."""
    monkeypatch.setattr(sys, "argv", [str(APP), *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        runpy.run_path(str(APP), run_name="__main__")
    return stopped.value.code


@pytest.fixture(scope="module")
def motions(tmp_path_factory):
    folder = tmp_path_factory.mktemp("motions")
    paths = []
    first = example_demonstrations(1)[0]
    # The same movement again, slower, and 2 cm aside.
    again = Demonstration.from_positions(
        1.2 * first.times, first.positions + [0.0, 0.02, 0.0], name="again"
    )
    for demonstration in (first, again):
        paths.append(folder / f"{demonstration.name}.txt")
        demonstration.save(paths[-1])
    return paths


def test_writes_primitive_figure_and_report(monkeypatch, tmp_path, capsys, motions):
    code = run_app(monkeypatch, motions[0], "--output", tmp_path)
    assert code == 0
    assert "as recorded" in capsys.readouterr().out
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["demonstrations"][0]["position_distance"] < 1e-4
    assert (tmp_path / "learn.png").stat().st_size > 50_000
    primitive = MovementPrimitive.load(tmp_path / "primitive.yaml")
    shown = Demonstration.load(motions[0])
    assert primitive.duration == pytest.approx(shown.duration)


@pytest.mark.parametrize("approximator", ["lwr", "gmr", "lwpr"])
def test_options_and_several_demonstrations(monkeypatch, tmp_path, capsys, motions, approximator):
    code = run_app(
        monkeypatch,
        *motions,
        *("--approximator", approximator, "--num-basis", "15", "--scaling", "none"),
        *("--smooth", "8", "--trim", "--mirror", "--from-floor"),
        *("--output", tmp_path, "--quiet"),
    )
    assert code == 0
    assert capsys.readouterr().out == ""
    primitive = MovementPrimitive.load(tmp_path / "primitive.yaml")
    assert primitive.approximator == approximator
    shown = [Demonstration.load(path) for path in motions]
    height = sum(d.positions[-1, 2] for d in shown) / 2
    assert primitive.goal[2] == pytest.approx(height - 0.82, abs=0.03)
    assert primitive.goal[1] == pytest.approx(-sum(d.positions[-1, 1] for d in shown) / 2, abs=0.03)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--approximator", "magic"], "approximator: 'magic' is unknown"),
        (["--num-basis", "0"], "at least 1"),
        (["--via", "0.5", "300", "-200", "100"], "--via: 374 m from the torso"),
        (["--scaling", "magic"], "scaling: 'magic'"),
        (["--orientation", "magic"], "orientation: 'magic'"),
        (["--smooth", "-1"], "--smooth: -1.0 Hz is not positive"),
    ],
)
def test_bad_options_are_one_sentence(monkeypatch, tmp_path, capsys, motions, options, words):
    demo = tmp_path / "turning.txt"
    shown = Demonstration.load(motions[0])
    Demonstration.from_positions(
        shown.times, shown.positions, rotations=[[1.0, 0, 0, 0]] * len(shown.times)
    ).save(demo)
    code = run_app(monkeypatch, demo, *options, "--output", tmp_path / "out")
    assert code == 2
    message = capsys.readouterr().err
    assert words in message
    assert message.count("\n") == 1


def test_a_bad_file_is_named(monkeypatch, tmp_path, capsys):
    (tmp_path / "bad.txt").write_text("0 0 0 0\n1 0 zero 0\n")
    assert run_app(monkeypatch, tmp_path / "bad.txt", "--output", tmp_path) == 2
    assert "bad.txt, line 2: 'zero' is not a number" in capsys.readouterr().err
