"""Compiled functions: what numba keeps of them, and where it cannot."""

import os
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import pytest
from numba.core.caching import CacheImpl

from pepper_drake.compiled import announce_compilation, compiled, load_compiled
from pepper_drake.learning.spring import advance_all

PACKAGE = Path(__file__).parents[1] / "pepper_drake"


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


def load(name, folder, text, **imported):
    """A module made of a text, with names imported from others; its file's time stays."""
    path = folder / f"{name}.py"
    path.write_text(text)
    os.utime(path, (1e9, 1e9))
    module = ModuleType(name)
    vars(module).update(imported, compiled=compiled)
    # Not by an import: Python, too, would take a file of the same time and size for the same.
    exec(compile(text, str(path), "exec"), vars(module))
    return module


class Moved(NamedTuple):
    """A type that another version of the package had elsewhere."""

    value: float


@pytest.mark.parametrize("kind", ["cut off", "of a type that has moved", "code cut off"])
def test_a_cache_that_cannot_be_read_is_made_anew(tmp_path, monkeypatch, kind):
    module = load("kept", tmp_path, "def twice(x):\n    return 2.0 * x[0]\n")
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


@pytest.mark.parametrize(
    ("before", "after"),
    [("3.0 * x", "5.0 * x"), ("x + x + x", "x + x + x + x + x"), ("FACTOR * x", "FACTOR * x")],
    ids=["another constant", "other code", "another constant of the module"],
)
def test_a_change_in_a_called_function_of_another_file_is_noticed(tmp_path, before, after):
    outer = "@compiled\ndef outer(x):\n    return middle(x) + 1.0\n"
    middle = "@compiled\ndef middle(x):\n    return inner(x)\n"
    for factor, body in ((3.0, before), (5.0, after)):
        text = f"FACTOR = {factor}\n@compiled\ndef inner(x):\n    return {body}\n"
        below = load("below", tmp_path, text)
        between = load("between", tmp_path, middle, inner=below.inner)
        above = load("above", tmp_path, outer, middle=between.middle)
        assert above.outer(2.0) == 2.0 * factor + 1.0
    # Unchanged, it is read.
    above = load("above", tmp_path, outer, middle=between.middle)
    assert above.outer(2.0) == 11.0
    assert sum(above.outer.stats.cache_hits.values()) == 1


def test_compiled_code_is_loaded_before_it_is_needed(tmp_path, monkeypatch):
    text = "@compiled\ndef {name}(x):\n    return x + x\n"
    first = load("first", tmp_path, text.format(name="double"))
    assert (first.double(2), first.double(1.5)) == (4, 3.0)
    again = load("first", tmp_path, text.format(name="double"))
    load_compiled(again.double)
    assert len(again.double.signatures) == 2
    assert sum(again.double.stats.cache_hits.values()) == 2
    # Nothing to load: it does not compile.
    changed = load("first", tmp_path, text.format(name="double").replace("x + x", "x + x + x"))
    monkeypatch.setattr(CacheImpl, "_locator_classes", [])
    for function in (changed.double, compiled(half)):
        load_compiled(function)
        assert not function.signatures
    assert changed.double(2) == 6


def test_a_broken_index_is_no_trouble_when_code_is_loaded(tmp_path):
    text = "@compiled\ndef triple(x):\n    return 3 * x\n"
    load("second", tmp_path, text).triple(2)
    (index,) = tmp_path.rglob("*.nbi")
    index.write_bytes(index.read_bytes()[:-20])
    again = load("second", tmp_path, text)
    load_compiled(again.triple)
    assert again.triple(2) == 6
