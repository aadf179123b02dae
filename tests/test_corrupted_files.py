"""A sample of `scripts/fuzz.py`: corrupted files are accepted or refused, and no more."""

import os
import random

import fuzz
import pytest

from pepper_drake.errors import InputError

FORMATS = fuzz.formats()


@pytest.mark.parametrize("name", FORMATS)
def test_a_good_file_is_accepted(tmp_path, name):
    FORMATS[name].read(FORMATS[name].make(tmp_path))


@pytest.mark.parametrize("name", FORMATS)
def test_corrupted_files_are_accepted_or_refused_in_one_line(tmp_path, name):
    seen = set()
    for number in range(12):
        folder = tmp_path / str(number)
        folder.mkdir()
        outcome, words = fuzz.try_one(FORMATS[name], f"test {name} {number}", folder)
        assert outcome in ("accepted", "refused"), (number, words)
        seen.add(outcome)
    assert "refused" in seen


@pytest.mark.parametrize("name", FORMATS)
def test_what_is_no_file_is_refused_at_once(tmp_path, name):
    path = FORMATS[name].make(tmp_path)
    path.unlink()
    path.symlink_to("/dev/zero")
    with pytest.raises(InputError):
        FORMATS[name].read(path)
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(InputError):
        FORMATS[name].read(path)
    path.unlink()
    path.mkdir()
    with pytest.raises(InputError):
        FORMATS[name].read(path)


FOLDERS = (
    "translation", "rotation", "joints_csv", "partial", "session_folder", "bimanual", "mesh", "log",
    "report", "run_scene", "reproduction", "recording_rosbag2", "recording_rosbag2_metadata",
    "recording_lerobot", "recording_lerobot_info",
)  # fmt: skip


@pytest.mark.parametrize("name", [name for name in FOLDERS if name in FORMATS])
def test_a_link_out_of_a_folder_that_was_handed_in_is_refused(tmp_path, name):
    folder = tmp_path / "handed"
    folder.mkdir()
    path = FORMATS[name].make(folder)
    other = tmp_path / f"elsewhere{path.suffix}"
    path.rename(other)
    path.symlink_to(other)
    with pytest.raises(InputError, match="leads out of its folder"):
        FORMATS[name].read(path)


def test_corruption_is_the_same_each_time(tmp_path):
    contents = []
    for folder in (tmp_path / "one", tmp_path / "two"):
        folder.mkdir()
        path = FORMATS["scene"].make(folder)
        fuzz.corrupt(path, random.Random("same"))
        contents.append(path.read_bytes())
    assert contents[0] == contents[1]
