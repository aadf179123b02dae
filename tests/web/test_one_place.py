"""Servers are made in one room, and systems on one base: held by reading the source."""

import ast
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
SOURCES = sorted([*(ROOT / "pepper_drake").rglob("*.py"), *(ROOT / "apps").glob("*.py")])


@cache
def nodes():
    """Every node of the sources' syntax trees that calls, imports, or is a class, by file."""
    kinds = (ast.Call, ast.ImportFrom, ast.ClassDef)
    return {
        path: [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, kinds)]
        for path in SOURCES
    }


def calls(path):
    for node in nodes()[path]:
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


def test_systems_have_the_base_that_lets_them_go():
    wrong = []
    for path in SOURCES:
        direct = {
            alias.asname or alias.name
            for node in nodes()[path]
            if isinstance(node, ast.ImportFrom) and node.module == "pydrake.systems.framework"
            for alias in node.names
        } & {"LeafSystem", "Diagram", "VectorSystem"}
        wrong += [
            f"{path.relative_to(ROOT)}:{node.lineno} {node.name}"
            for node in nodes()[path]
            if isinstance(node, ast.ClassDef) and path.name != "framework.py"
            if {getattr(base, "id", "") for base in node.bases} & direct
        ]
    assert not wrong
