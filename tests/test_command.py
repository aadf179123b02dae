"""The command of the installed package: the same scripts as in apps/, from any folder."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

from pepper_drake import __main__, cli

ROOT = Path(__file__).parents[1]


PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def python(*arguments, cwd, package=ROOT):
    environment = {"PYTHONPATH": str(package), "PATH": "/usr/bin:/bin"}
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=environment,
    )


def command(*arguments, **where):
    return python("-m", "pepper_drake", *arguments, **where)


def test_the_overview_names_every_app_with_what_it_does(tmp_path):
    ran = command("--help", cwd=tmp_path)
    assert ran.returncode == 0
    for path in (ROOT / "apps").glob("*.py"):
        assert f"  {path.stem} " in ran.stdout


def test_an_app_runs_under_its_name_in_any_folder(tmp_path):
    ran = command("learn", "--help", cwd=tmp_path)
    assert ran.returncode == 0
    assert ran.stdout.startswith("usage: pepper-drake learn ")
    assert "(see pepper-drake import)" in ran.stdout


def test_an_unknown_name_is_answered_with_those_there_are(tmp_path):
    ran = command("fly", cwd=tmp_path)
    assert ran.returncode == 2
    assert ran.stderr.startswith('error: there is no "fly"; choose one of benchmark, ')


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_completion_knows_names_and_options(monkeypatch, capsys, shell):
    pytest.importorskip("shtab", reason="completion is an extra")
    monkeypatch.setattr(sys, "argv", ["pepper-drake", "completion", shell])
    assert __main__.main() == cli.EXIT_DONE
    assert "--random-scene" in capsys.readouterr().out


@pytest.fixture(scope="module")
def packages(tmp_path_factory):
    """Paths of the wheel and the source package."""
    pytest.importorskip("build", reason="building is for developers")
    folder = tmp_path_factory.mktemp("packages")
    subprocess.run(
        [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder), str(ROOT)],
        check=True,
        capture_output=True,
    )
    return sorted(folder.iterdir())


def test_wheel_and_source_package_hold_what_an_installation_needs(packages):
    assert [path.suffix for path in packages] == [".whl", ".gz"]
    subprocess.run([sys.executable, "-m", "twine", "check", "--strict", *packages], check=True)
    listing = subprocess.run(
        [sys.executable, "-m", "zipfile", "-l", str(packages[0])],
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    for name in ("apps/reach.py", "models/pepper/pepper.urdf", "models/scenes/table.yaml"):
        assert f"pepper_drake/{name}" in listing


def test_an_installed_wheel_runs_in_an_empty_folder(packages, tmp_path):
    """With the dependencies that are here, and nothing of the checkout."""
    installed, empty = tmp_path / "installed", tmp_path / "empty"
    empty.mkdir()
    install = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index"]
    subprocess.run([*install, "--target", str(installed), str(packages[0])], check=True)
    for arguments, expected in (
        (["--version"], f"pepper-drake {PROJECT['version']}"),
        (["describe", "--quiet"], ""),
    ):
        ran = command(*arguments, cwd=empty, package=installed)
        assert (ran.returncode, ran.stdout.strip(), ran.stderr) == (0, expected, "")
    assert (empty / "out" / "describe" / "pepper_standard.urdf").exists()
    where = "import pepper_drake; print(pepper_drake.__file__)"
    ran = python("-c", where, cwd=empty, package=installed)
    assert Path(ran.stdout.strip()).is_relative_to(installed)


def test_container_and_citation_are_of_this_package():
    lines = (ROOT / "Dockerfile").read_text().splitlines()
    copied = [word for line in lines if line.startswith("COPY") for word in line.split()[1:-1]]
    assert "constraints.txt" in copied
    assert [name for name in copied if not (ROOT / name).exists()] == []
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert (citation["version"], citation["license"]) == (PROJECT["version"], "BSD-3-Clause")
