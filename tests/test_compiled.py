"""Compiled functions: what numba keeps of them, and where it cannot."""

import ast
import importlib.util
from pathlib import Path
from typing import NamedTuple

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


class Moved(NamedTuple):
    """A type that another version of the package had elsewhere."""

    value: float


@pytest.mark.parametrize("kind", ["cut off", "of a type that has moved", "code cut off"])
def test_a_cache_that_cannot_be_read_is_made_anew(tmp_path, monkeypatch, kind):
    source = tmp_path / "kept.py"
    source.write_text("def twice(x):\n    return 2.0 * x[0]\n")
    spec = importlib.util.spec_from_file_location("kept", source)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    assert compiled(module.twice)(Moved(1.5)) == 3.0

    (index,), (code,) = tmp_path.rglob("*.nbi"), tmp_path.rglob("*.nbc")
    if kind == "of a type that has moved":
        monkeypatch.delattr(f"{__name__}.Moved")
        again = NamedTuple("Again", [("value", float)])(1.5)
    else:
        broken = code if "code" in kind else index
        broken.write_bytes(broken.read_bytes()[:-20])
        again = Moved(1.5)
    for _ in range(2):
        assert compiled(module.twice)(again) == 3.0


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
