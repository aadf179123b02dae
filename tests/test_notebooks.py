"""The notebooks run from top to bottom, and are stored without what they show."""

import ast
import json
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[1] / "docs" / "notebooks").glob("*.ipynb"))


def cells(path):
    """The code of each cell, without commands to the notebook itself."""
    for cell in json.loads(path.read_text())["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            assert cell["execution_count"] is None
            yield "".join(line for line in cell["source"] if not line.startswith("%"))


def shown(code, names):
    """Runs a cell, and returns the value of its last line, as a notebook shows it."""
    *body, last = ast.parse(code).body
    if not isinstance(last, ast.Expr):
        exec(code, names)
        return None
    exec(compile(ast.Module(body, []), "cell", "exec"), names)
    return eval(compile(ast.Expression(last.value), "cell", "eval"), names)


@pytest.mark.render
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path):
    names = {"__name__": "__main__"}
    views = [shown(code, names) for code in cells(path)]
    assert len(views) > 3
    assert any(hasattr(view, "_repr_html_") or hasattr(view, "savefig") for view in views)


def test_there_are_three():
    assert [path.stem for path in NOTEBOOKS] == ["learning", "perception", "reaching"]
