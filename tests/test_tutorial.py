"""The tutorial does what it says: its commands and its Python run, and print what it prints."""

import contextlib
import io
import itertools
import re
import runpy
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from pictures import is_like

from pepper_drake import cli
from tests.printed import is_as_shown, missing

ROOT = Path(__file__).parents[1]
TUTORIAL = ROOT / "docs" / "tutorial.md"
SHOWN_ONLY = "<!-- shown only -->"


@dataclass
class Block:
    language: str
    text: str
    line: int
    executed: bool


def blocks():
    text = TUTORIAL.read_text()
    found = []
    for match in re.finditer(r"^```(\w+)\n(.*?)^```$", text, flags=re.MULTILINE | re.DOTALL):
        before = text[: match.start()].rstrip()
        found.append(
            Block(
                language=match.group(1),
                text=match.group(2),
                line=text[: match.start()].count("\n") + 1,
                executed=match.group(1) in ("sh", "python") and not before.endswith(SHOWN_ONLY),
            )
        )
    return found


BLOCKS = blocks()
APP_COMMAND = re.compile(r"^\.venv/bin/python (apps/\w+\.py)(.*)$", flags=re.MULTILINE)

EXECUTED = [block for block in BLOCKS if block.executed]
APPS = sorted({app for block in BLOCKS for app, _ in APP_COMMAND.findall(block.text)})
SHOWN_OUTPUTS = {
    block.line: after
    for block, after in itertools.pairwise(BLOCKS)
    if block.executed and after.language == "text"
}


def run_app(line):
    """Runs a command line of an app in this process: imports are most of the time it takes."""
    _, app, *arguments = shlex.split(line)
    sys.argv = [app, *arguments]
    with pytest.raises(SystemExit) as end:
        runpy.run_path(str(ROOT / app), run_name="__main__")
    assert not end.value.code, line


def run_block(block, names):
    """Runs a block; Python's blocks share their names."""
    if block.language == "python":
        exec(compile(block.text, f"tutorial line {block.line}", "exec"), names)
    elif block.text.startswith(".venv/bin/python "):
        for line in block.text.replace("\\\n", " ").splitlines():
            run_app(line)
    else:
        subprocess.run(["bash", "-euc", block.text], check=True)


def printed_by(action, *arguments):
    with contextlib.redirect_stdout(io.StringIO()) as output:
        action(*arguments)
    return output.getvalue()


def run_tutorial(folder, monkeypatch):
    """Returns the output of each executed block, and of each app's help."""
    # It would take standard output away from us.
    monkeypatch.setattr(cli, "quiet_libraries", lambda: None)
    monkeypatch.setattr(sys, "argv", sys.argv)
    monkeypatch.chdir(folder)
    (folder / "pepper_drake").symlink_to(ROOT / "pepper_drake")
    names = {}
    printed = [printed_by(run_block, block, names) for block in EXECUTED]
    return printed, {app: printed_by(run_app, f"python {app} --help") for app in APPS}


def test_the_tutorial_runs_and_shows_what_is_printed(tmp_path, monkeypatch):
    """Words as they stand, numbers alike."""
    printed, helps = run_tutorial(tmp_path, monkeypatch)
    for block, output in zip(EXECUTED, printed, strict=True):
        shown = SHOWN_OUTPUTS[block.line].text.splitlines() if block.line in SHOWN_OUTPUTS else []
        assert missing(shown, output) == [], output
    for made in ("learned/learn.png", "smooth/paths.png"):
        assert is_like(tmp_path / "out" / made, TUTORIAL.parent / "tutorial" / Path(made).name)
    for block in BLOCKS:
        for app, arguments in APP_COMMAND.findall(block.text):
            for option in re.findall(r"--[a-z-]+", arguments):
                assert option in helps[app], (block.line, option)


def test_numbers_may_differ_a_little_and_words_may_not():
    assert is_as_shown("reached 0.6 mm in 26 ms", "reached   0.5 mm in 310.5 ms")
    assert is_as_shown("learned to 6.1e-06 m", "learned to 5.9e-06 m")
    for other in ("missed 0.6 mm", "reached mm", "reached 1.0 mm", "reached 0.6 mm (60 steps)"):
        assert not is_as_shown("reached 0.6 mm", other)
    assert not is_as_shown("learned to 6.1e-06 m", "learned to 6.1e-05 m")


def test_most_of_the_tutorial_is_executed():
    assert len(EXECUTED) >= 8
    assert len(SHOWN_OUTPUTS) >= 5


def test_what_the_tutorial_links_to_is_there():
    for link in re.findall(r"\]\(([^)#]+)", TUTORIAL.read_text()):
        assert link.startswith("https://") or (TUTORIAL.parent / link).exists(), link
