"""The command of the installed package: the same scripts as in apps/, from any folder."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


def command(*arguments, cwd):
    environment = {"PYTHONPATH": str(ROOT), "PATH": "/usr/bin:/bin"}
    return subprocess.run(
        [sys.executable, "-m", "pepper_drake", *arguments],
        capture_output=True,
        text=True,
        cwd=cwd,
        env=environment,
    )


def test_the_overview_names_every_app_with_what_it_does(tmp_path):
    ran = command("--help", cwd=tmp_path)
    assert ran.returncode == 0
    for path in (ROOT / "apps").glob("*.py"):
        assert f"  {path.stem} " in ran.stdout


def test_an_app_runs_under_its_name_in_any_folder(tmp_path):
    ran = command("learn", "--help", cwd=tmp_path)
    assert ran.returncode == 0
    assert ran.stdout.startswith("usage: pepper-drake learn ")


def test_an_unknown_name_is_answered_with_those_there_are(tmp_path):
    ran = command("fly", cwd=tmp_path)
    assert ran.returncode == 2
    assert ran.stderr.startswith('error: there is no "fly"; choose one of benchmark, ')


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_completion_knows_names_and_options(tmp_path, shell):
    pytest.importorskip("shtab", reason="completion is an extra")
    ran = command("completion", shell, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    assert "--random-scene" in ran.stdout


def test_wheel_and_source_package_hold_what_an_installation_needs(tmp_path):
    pytest.importorskip("build", reason="building is for developers")
    subprocess.run(
        [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(tmp_path), str(ROOT)],
        check=True,
        capture_output=True,
    )
    packages = sorted(tmp_path.iterdir())
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
