"""An app run in this process: most of the time that a process of its own takes is imports."""

import importlib.util
import runpy
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from pepper_drake import cli

APPS = Path(__file__).parents[2] / "apps"


class AppRun(NamedTuple):
    """Result of an app; the names are those of `subprocess.CompletedProcess`."""

    returncode: int
    stdout: str
    stderr: str


@pytest.fixture
def run_app(monkeypatch, capsys):
    """Returns a function that runs the app of a name with arguments."""
    # It would take standard output away from the test.
    monkeypatch.setattr(cli, "quiet_libraries", lambda: None)

    def run(name, *arguments):
        monkeypatch.setattr(sys, "argv", [f"{name}.py", *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            runpy.run_path(str(APPS / f"{name}.py"), run_name="__main__")
        captured = capsys.readouterr()
        return AppRun(end.value.code, captured.out, captured.err)

    return run


def load_app(name):
    """The app of a name as a module."""
    spec = importlib.util.spec_from_file_location(f"{name}_app", APPS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def call_app(monkeypatch, capsys):
    """Returns a function that runs an app's module: exit code, standard output and error."""
    monkeypatch.setattr(cli, "quiet_libraries", lambda: None)

    def call(module, *arguments):
        monkeypatch.setattr(sys, "argv", [Path(module.__file__).name, *map(str, arguments)])
        with pytest.raises(SystemExit) as end:
            cli.run(module.main)
        captured = capsys.readouterr()
        return end.value.code, captured.out, captured.err

    return call
