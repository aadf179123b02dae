"""Compiled functions: what numba keeps of them, and where it cannot."""

import ast
from pathlib import Path

import pytest
from numba.core.caching import CacheImpl

from pepper_drake.compiled import announce_compilation, compiled
from pepper_drake.learning.spring import advance_all

PACKAGE = Path(__file__).parents[1] / "pepper_drake"


def is_compiled(node):
    return isinstance(node, ast.FunctionDef) and any(
        ast.unparse(decorator) == "compiled" for decorator in node.decorator_list
    )


def half(x):
    return 0.5 * x


def test_it_is_compiled_where_no_folder_can_be_written_to(monkeypatch):
    monkeypatch.setattr(CacheImpl, "_locator_classes", [])
    assert compiled(half)(3.0) == pytest.approx(1.5)


def test_compilation_is_announced_once_to_who_waits(capsys, monkeypatch):
    # What was kept of an earlier run would not be compiled.
    monkeypatch.setattr(CacheImpl, "_locator_classes", [])
    announce_compilation()
    for factor in (2.0, 3.0):
        compiled(lambda x, by=factor: by * x)(1.0)
    assert capsys.readouterr().err.count("Compiling numerical functions") == 1


def test_it_is_kept_where_a_folder_can_be_written_to():
    assert advance_all.stats.cache_path


def test_nothing_else_compiles():
    users = [path.name for path in PACKAGE.rglob("*.py") if "from numba" in path.read_text()]
    assert users == ["compiled.py"]


def test_compiled_code_takes_nothing_from_other_files_of_the_package():
    count, taken = 0, []
    for path in sorted(PACKAGE.rglob("*.py")):
        tree = ast.parse(path.read_text())
        ours = {
            alias.asname or alias.name
            for node in ast.walk(tree)
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("pepper_drake")
            for alias in node.names
        }
        for function in filter(is_compiled, tree.body):
            count += 1
            names = {
                node.id
                for statement in function.body
                for node in ast.walk(statement)
                if isinstance(node, ast.Name)
            }
            taken += [f"{path.name}: {function.name} uses {name}" for name in names & ours]
    assert count > 20
    assert not taken
