"""Docstrings say what a thing is, in the field's term: none begins as an indirect question."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
QUESTION = re.compile(r"\s*(What|Whether|Of|How|Where)\b")


def docstrings(source):
    """Yields line and text of each text that stands alone."""
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Expr(value=ast.Constant(value=str(text))):
                yield node.lineno, text


@pytest.mark.parametrize(
    "room", ["pepper_drake", "apps", "benchmarks", "examples", "scripts", "tests"]
)
def test_no_docstring_begins_as_a_question(room):
    wrong = [
        f"{path.relative_to(ROOT)}:{line}: {text.splitlines()[0]}"
        for path in sorted((ROOT / room).rglob("*.py"))
        for line, text in docstrings(path.read_text())
        if QUESTION.match(text)
    ]
    assert not wrong


def test_a_question_is_found():
    source = 'SPEED = 1.0\n"""How fast it is."""\n\ndef stop():\n    """Stops."""\n'
    assert [line for line, text in docstrings(source) if QUESTION.match(text)] == [2]
