"""A sample of `scripts/fuzz.py`: corrupted files are accepted or refused, and no more."""

import os
import random
import shutil

import fuzz
import pytest

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning.demonstrations.demonstration_folder import load_all
from pepper_drake.playback.loading import load_motion

FORMATS = fuzz.formats()


@pytest.mark.parametrize("name", FORMATS)
def test_a_good_file_is_accepted(tmp_path, name):
    FORMATS[name].read(FORMATS[name].make(tmp_path))


@pytest.mark.parametrize("name", FORMATS)
def test_corrupted_files_are_accepted_or_refused_in_one_line(tmp_path, name):
    seen = set()
    with fuzz.made_files(FORMATS[name]) as good:
        for number in range(12):
            folder = tmp_path / str(number)
            folder.mkdir()
            outcome, words = fuzz.try_one(FORMATS[name], f"test {name} {number}", folder, good)
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


LINKS = (
    ("translation", "a.txt", lambda folder: load_all([folder])),
    ("pose", "a_pose.txt", lambda folder: Demonstration.load(folder / "a.txt")),
    ("primitive", "primitive.yaml", load_motion),
    ("log", "interrupted", load_motion),
    ("translation", "demonstration", load_motion),
)
"""Formats, where a link to their file or its folder is in a folder, and what reads that."""


@pytest.mark.parametrize(("name", "link", "read"), LINKS)
def test_a_link_to_what_a_folder_may_hold_is_refused(tmp_path, name, link, read):
    folder, elsewhere = tmp_path / "handed", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    shutil.copy(FORMATS["translation"].make(elsewhere), folder / "a.txt")
    path = FORMATS[name].make(elsewhere)
    (folder / link).unlink(missing_ok=True)
    (folder / link).symlink_to(path if "." in link else elsewhere)
    with pytest.raises(InputError, match=f"{link}: leads out of its folder"):
        read(folder)


def test_corruption_is_the_same_each_time(tmp_path):
    contents = []
    for folder in (tmp_path / "one", tmp_path / "two"):
        folder.mkdir()
        path = FORMATS["scene"].make(folder)
        fuzz.corrupt(path, random.Random("same"))
        contents.append(path.read_bytes())
    assert contents[0] == contents[1]
