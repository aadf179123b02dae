"""Whatever a file holds, it is read, or refused with one sentence that names it."""

import os
import sys

import numpy as np
import pytest
from scipy.io import savemat

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning.demonstrations.check import examine
from pepper_drake.learning.demonstrations.importers.table import number

from .mutations import mutate
from .recordings import BINARIES, TEXTS, main_file, make_motion

MUTATIONS = 40


def survives(path, file, content, rng):
    file.write_bytes(mutate(content, rng))
    demo, said = None, ""
    try:
        demo = Demonstration.load(path)
    except InputError as error:
        said = str(error)
    if demo is None:
        assert str(path) in said
        assert "\n" not in said
        assert len(said) < 700
    else:
        assert np.isfinite(demo.positions).all()
        examine(demo)


@pytest.mark.parametrize("name", TEXTS)
def test_a_broken_text_is_read_or_refused(name, tmp_path):
    path = TEXTS[name](tmp_path, make_motion(rate=25.0))
    content = path.read_bytes()
    for seed in range(MUTATIONS):
        survives(path, path, content, np.random.default_rng(seed))


@pytest.mark.parametrize("name", BINARIES)
def test_a_broken_binary_is_read_or_refused(name, tmp_path):
    library, write = BINARIES[name]
    pytest.importorskip(library, reason=f"{library} is not installed: .[formats] has it")
    path = write(tmp_path, make_motion(rate=25.0))
    file = main_file(path)
    content = file.read_bytes()
    for seed in range(MUTATIONS):
        survives(path, file, content, np.random.default_rng(seed))


@pytest.mark.parametrize(
    "suffix", [".txt", ".csv", ".mat", ".bag", ".db3", ".mcap", ".parquet", ".xar", ".py"]
)
@pytest.mark.parametrize(
    "content",
    [b"", b"\0" * 100, bytes(range(256)) * 20, b"<" * 1000, b"9" * 10_000, b",\n" * 1000],
    ids=["nothing", "zeros", "every byte", "brackets", "one number", "commas"],
)
def test_rubbish_is_refused_whatever_it_is_called(suffix, content, tmp_path):
    path = tmp_path / f"rubbish{suffix}"
    path.write_bytes(content)
    with pytest.raises(InputError, match="rubbish"):
        Demonstration.load(path)


def test_a_name_of_brackets_is_refused_unread(tmp_path):
    path = tmp_path / "names.csv"  # To look for a unit in it would take minutes.
    path.write_text(f"time,x{'[' * 100_000},y\n0.0,0.1,0.2\n0.1,0.2,0.3\n")
    with pytest.raises(InputError, match=r"names\.csv"):
        Demonstration.load(path)


@pytest.mark.parametrize("suffix", [".txt", ".csv", ".mat", ".mcap", ".parquet"])
def test_a_pipe_is_refused_at_once(suffix, tmp_path):
    path = tmp_path / f"pipe{suffix}"
    os.mkfifo(path)
    with pytest.raises(InputError, match="pipe"):
        Demonstration.load(path)
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "folder" / "translation.txt")
    with pytest.raises(InputError, match=r"translation\.txt"):
        Demonstration.load(tmp_path / "folder")


def test_a_file_that_is_too_large_is_refused_unread(tmp_path):
    path = tmp_path / "large.txt"
    with path.open("wb") as file:
        file.truncate(2**33)
    with pytest.raises(InputError, match="MiB"):
        Demonstration.load(path)


def test_entities_in_xml_are_not_expanded(tmp_path):
    bomb = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]><x>&b;</x>'
    path = tmp_path / "behavior.xar"
    path.write_text(bomb)
    with pytest.raises(InputError, match="entities"):
        Demonstration.load(path)


@pytest.mark.parametrize(
    ("library", "name"), [("rosbags", "motion.bag"), ("pyarrow", "data.parquet")]
)
def test_a_missing_library_is_named_with_the_way_to_get_it(library, name, tmp_path, monkeypatch):
    for module in list(sys.modules):
        if module == library or module.startswith(f"{library}."):
            monkeypatch.delitem(sys.modules, module)
    monkeypatch.setitem(sys.modules, library, None)
    path = tmp_path / name
    path.write_bytes(b"content")
    (tmp_path / "meta").mkdir()
    info = '{"fps": 50, "features": {"observation.state": {"names": ["x", "y", "z"]}}}'
    (tmp_path / "meta" / "info.json").write_text(info)
    with pytest.raises(InputError, match=rf"{library}.*pip install"):
        Demonstration.load(path)


def test_a_matlab_file_that_unpacks_to_gigabytes_is_refused(tmp_path):
    path = tmp_path / "bomb.mat"
    savemat(path, {"demos": np.zeros(9_000_000)}, do_compression=True)
    assert path.stat().st_size < 100_000
    with pytest.raises(InputError, match=r"bomb\.mat: holds more than 64 MiB"):
        Demonstration.load(path)


@pytest.mark.parametrize("word", ["1.5D-01", "+.5d0", "-2.D+1", "3D2"])
def test_fortrans_exponents_are_read(word):
    assert number(word, "here") == float(word.replace("D", "e").replace("d", "e"))


def test_many_digits_that_are_no_number_are_refused():
    # A pattern in which digits may belong to two parts tries them all: a minute for this one.
    with pytest.raises(InputError, match="is not a number"):
        number(f"{'8' * 100_000}x", "here")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("broken.bag", "was its recording broken off. Repair it with rosbag reindex"),
        ("motion.bag.active", "a ROS bag by another name.*rosbag reindex"),
    ],
)
def test_a_bag_that_was_not_closed_says_how_to_repair_it(tmp_path, name, words):
    pytest.importorskip("rosbags", reason="rosbags is not installed: .[formats] has it")
    path = tmp_path / name
    path.write_bytes(b"#ROSBAG V2.0\n" + b" " * 4096)
    with pytest.raises(InputError, match=words) as caught:
        Demonstration.load(path)
    assert str(caught.value).startswith(str(path))
