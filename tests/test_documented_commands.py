"""Every command line of README and docs parses with its app's own parser; nothing is run."""

import re
import runpy
import shlex
import sys
from functools import cache
from pathlib import Path

import pytest

from pepper_drake import cli

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
APP = re.compile(r"(?:\S*python |… )?(?:apps/(\w+)\.py|pepper-drake (\w+))(?: |$)(.*)")
NO_APPS = {"completion"}
# Words in capitals stand for a value of one's own; these have to be numbers.
NUMBERS = {"ID": "7", "M": "0.05"}


class ParsedError(Exception):
    """Ends an app once its command line has been read."""


@cache
def main_of(app):
    """The app's `main`; its module is loaded once."""
    return runpy.run_path(str(ROOT / "apps" / f"{app}.py"), run_name=app)["main"]


def command_lines(text):
    """App and arguments of each command line in a page's shell blocks and in its text.

    An app without arguments in the text is its name, and no command line.
    """
    blocks = re.findall(r"^```sh\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    lines = [line for block in blocks for line in block.replace("\\\n", " ").splitlines()]
    prose = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    found = [APP.fullmatch(line.strip()) for line in lines]
    spans = [APP.fullmatch(span) for span in re.findall(r"(?<!`)`([^`\n]+)`(?!`)", prose)]
    found += [span for span in spans if span and span[3]]
    for match in filter(None, found):
        app = match[1] or match[2]
        if app not in NO_APPS:
            words = shlex.split(match[3], comments=True)
            yield app, [NUMBERS.get(word, word) for word in words]


def error_of(app, words, monkeypatch, capsys):
    """The error message of an app's parser; empty if it takes the words."""

    def read(parser):
        super(cli.OneLineParser, parser).parse_args()
        raise ParsedError

    monkeypatch.setattr(cli.OneLineParser, "parse_args", read)
    monkeypatch.setattr(sys, "argv", [f"{app}.py", *words])
    with pytest.raises((ParsedError, SystemExit)) as end:
        main_of(app)()
    error = capsys.readouterr().err
    asked_for_help = end.type is SystemExit and end.value.code == 0
    return "" if end.type is ParsedError or asked_for_help else f"{app} {words}: {error}"


@pytest.mark.parametrize("path", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_command_lines_parse(path, monkeypatch, capsys):
    for app, words in command_lines(path.read_text()):
        assert not error_of(app, words, monkeypatch, capsys)


def test_command_lines_are_found_and_wrong_ones_are_told(monkeypatch, capsys):
    text = """Say `pepper-drake reach` or `… apps/learn.py a/ --num-basis x`.
```sh
make reach
.venv/bin/python apps/play.py \\
  out/reach  # A comment.
```
"""
    found = list(command_lines(text))
    assert found == [("play", ["out/reach"]), ("learn", ["a/", "--num-basis", "x"])]
    errors = [error_of(*one, monkeypatch, capsys) for one in found]
    assert errors[0] == ""
    assert "argument --num-basis" in errors[1]
    lines = [line for path in PAGES for line in command_lines(path.read_text())]
    assert len(lines) > 100
