import itertools
import os
import re
import stat
import xml.etree.ElementTree as ET
from functools import partial
from pathlib import Path

import pytest

from pepper_drake import cli
from pepper_drake.models.scene import load_scene
from pepper_drake.reporting.diagram_graph import make_diagram_graph
from pepper_drake.scenario import Scenario, load_scenario
from tests.apps.conftest import load_app

APP = Path(__file__).parents[2] / "apps" / "diagram.py"

DOCS = APP.parents[1] / "docs"


def texts(picture):
    """All that is written in a picture."""
    return re.findall(r"<!-- (.+) -->", picture.read_text())


@pytest.fixture
def app():
    return load_app("diagram")


@pytest.fixture
def run(app, call_app, monkeypatch):
    """Runs the app without Graphviz: exit code, standard output, standard error."""
    monkeypatch.setattr(app.shutil, "which", lambda program: None)
    return partial(call_app, app)


@pytest.mark.parametrize("name", ["reaching", "station", "teaching"])
def test_a_picture_comes_out_on_a_machine_without_graphviz(name, run, tmp_path):
    code, printed, error = run(name, "--output", tmp_path)
    assert (code, error) == (cli.EXIT_DONE, "")
    assert "graphviz" in printed
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"{name}.dot", f"{name}.svg"]
    assert (tmp_path / f"{name}.dot").read_text().startswith("digraph")
    root = ET.parse(tmp_path / f"{name}.svg").getroot()
    assert root.tag.endswith("svg")
    width, height = (float(root.get(side).removesuffix("pt")) for side in ("width", "height"))
    assert min(width, height) > 200
    assert width * height > 300**2
    if name == "reaching":
        assert texts(tmp_path / "reaching.svg") == texts(DOCS / "reaching.svg")


def test_the_same_diagram_gives_the_same_picture(run, tmp_path):
    pictures = []
    for folder in ("one", "two"):
        run("teaching", "--output", tmp_path / folder)
        pictures.append((tmp_path / folder / "teaching.svg").read_text())
    assert pictures[0] == pictures[1]


@pytest.fixture(scope="module")
def reaching():
    return load_app("diagram").build("reaching", Scenario(scene=load_scene("free")))


def test_the_reach_shows_the_loop_from_cameras_to_joints(reaching):
    graph = make_diagram_graph(reaching)
    chain = ("station", "perception", "arm_controller", "safety", "station")
    for sender, receiver in itertools.pairwise(chain):
        assert (sender, receiver) in graph.edges
    # What measures the truth tells nobody.
    assert not any(sender == "clearance_monitor" for sender, _ in graph.edges)


def test_depth_opens_the_station(reaching):
    names = make_diagram_graph(reaching, 2).nodes
    assert "station" not in names
    assert {"station/plant", "station/camera_depth", "supervisor"} <= set(names)


def test_the_scenario_says_what_is_drawn(app):
    for stereo in (False, True):
        scenario = load_scenario(None, [f"station.stereo={str(stereo).lower()}"])
        nodes = make_diagram_graph(app.build("station", scenario)).nodes
        assert ("camera_depth_sensor" in nodes) != stereo


def test_where_dot_is_installed_every_port_is_drawn_too(app, call_app, tmp_path, monkeypatch):
    dot = tmp_path / "bin" / "dot"
    dot.parent.mkdir()
    dot.write_text('#!/bin/sh\n# Stands in for Graphviz: dot -Tsvg FILE -o OUT.\ncp "$2" "$4"\n')
    dot.chmod(dot.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{dot.parent}:{os.environ['PATH']}")
    code, printed, error = call_app(app, "teaching", "--output", tmp_path / "out")
    assert (code, error) == (cli.EXIT_DONE, "")
    assert "graphviz" not in printed
    drawn = (tmp_path / "out" / "teaching_ports.svg").read_text()
    assert drawn == (tmp_path / "out" / "teaching.dot").read_text()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("flying",), ("'flying'", "reaching", "station", "teaching")),
        (("--depth", "0"), ('"0"', "1 or above")),
        (("--depth", "all"), ('"all"', "1 or above")),
        (("--scene", "nowhere.yaml"), ("nowhere.yaml", "table")),
        (("--set", "station.sterio=true"), ("sterio", "stereo")),
    ],
)
def test_bad_input_is_one_sentence(arguments, words, run, tmp_path):
    code, printed, error = run(*arguments, "--output", tmp_path / "out")
    assert (code, printed) == (cli.EXIT_BAD_INPUT, "")
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    for word in words:
        assert word in error
    assert not (tmp_path / "out").exists()
