import os
import signal
import subprocess
import sys

import pytest

from pepper_drake.errors import InputError
from pepper_drake.results.folder import check_writable, whole_results

NAMES = ("report.json", "log.npz", "recording.html")


def write(folder, text, names=NAMES):
    with whole_results(folder, NAMES) as inside:
        for name in names:
            (inside / name).write_text(text)


def read(folder):
    return {entry.name: entry.read_text() for entry in folder.iterdir() if entry.is_file()}


def test_new_results_take_the_place_of_all_old_ones(tmp_path):
    folder = tmp_path / "out" / "reach"
    write(folder, "old")
    (folder / "mine.txt").write_text("mine")
    write(folder, "new", ("report.json", "log.npz"))
    assert read(folder) == {"report.json": "new", "log.npz": "new", "mine.txt": "mine"}
    assert sorted(os.listdir(folder)) == ["log.npz", "mine.txt", "report.json"]


@pytest.mark.parametrize("problem", [RuntimeError, KeyboardInterrupt, OSError(28, "disk full")])
def test_what_fails_leaves_the_old_ones(tmp_path, problem):
    write(tmp_path, "old")

    def fail():
        with whole_results(tmp_path, NAMES) as inside:
            (inside / "log.npz").write_text("new")
            raise problem

    with pytest.raises((RuntimeError, KeyboardInterrupt, InputError)):
        fail()
    assert read(tmp_path) == dict.fromkeys(NAMES, "old")
    assert len(os.listdir(tmp_path)) == 3


def test_a_folder_in_the_results_takes_the_place_of_the_old_one(tmp_path):
    for text in ("old", "new"):
        with whole_results(tmp_path, NAMES) as inside:
            (inside / "corrected").mkdir()
            (inside / "corrected" / f"{text}.txt").write_text(text)
    assert os.listdir(tmp_path / "corrected") == ["new.txt"]


def test_what_a_killed_program_left_goes_with_the_next(tmp_path):
    program = (
        "import os, pathlib, signal\n"
        "from pepper_drake.results.folder import whole_results\n"
        f"with whole_results(pathlib.Path({str(tmp_path)!r}), ()) as inside:\n"
        "    (inside / 'log.npz').write_text('new')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    write(tmp_path, "old")
    assert subprocess.run([sys.executable, "-c", program]).returncode == -signal.SIGKILL
    assert read(tmp_path) == dict.fromkeys(NAMES, "old")
    write(tmp_path, "new")
    assert sorted(os.listdir(tmp_path)) == sorted(NAMES)


def test_what_cannot_be_written_to_is_said_before(tmp_path):
    (tmp_path / "file").write_text("in the way")
    for folder in (tmp_path / "file", tmp_path / "file" / "out", tmp_path / ("x" * 300)):
        with pytest.raises(InputError, match="cannot be written to"):
            check_writable(folder)
    check_writable(tmp_path / "a" / "b")
    assert os.listdir(tmp_path) == ["file"]
