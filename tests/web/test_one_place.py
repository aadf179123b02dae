"""Servers are made in one room, and systems on one base: held by reading the source."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = sorted([*(ROOT / "pepper_drake").rglob("*.py"), *(ROOT / "apps").glob("*.py")])


def calls(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Call):
            function = node.func
            yield getattr(function, "id", getattr(function, "attr", "")), node.lineno


def places(names, *, besides):
    return [
        f"{path.relative_to(ROOT)}:{line} {name}"
        for path in SOURCES
        if not path.is_relative_to(ROOT / besides)
        for name, line in calls(path)
        if name in names
    ]


def test_a_meshcat_is_made_where_its_door_is_shut():
    assert not places({"Meshcat", "StartMeshcat"}, besides="pepper_drake/web")


def test_diagrams_are_built_where_they_can_be_freed():
    assert not places({"BuildInto"}, besides="pepper_drake/systems/framework.py")


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: path.stem)
def test_systems_have_the_base_that_lets_them_go(path):
    tree = ast.parse(path.read_text())
    direct = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == "pydrake.systems.framework"
        for alias in node.names
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef) and path.name != "framework.py":
            bases = {getattr(base, "id", "") for base in node.bases}
            assert not bases & direct & {"LeafSystem", "Diagram", "VectorSystem"}, node.name
