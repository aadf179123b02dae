import json
import os

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.files import path_inside, read_bytes, read_json, read_text, write_atomically


def test_what_was_written_is_read_back(tmp_path):
    path = tmp_path / "new" / "text.txt"
    write_atomically(path, "Schönes Öl\n")
    assert read_text(path) == "Schönes Öl\n"
    write_atomically(path, b"\xef\xbb\xbfmarked")
    assert read_text(path) == "marked"
    assert [entry.name for entry in path.parent.iterdir()] == ["text.txt"]


def test_a_pipe_a_device_and_a_folder_are_refused_at_once(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (pipe, tmp_path, "/dev/zero", "/dev/null"):
        with pytest.raises(InputError, match="not a regular file"):
            read_bytes(path)


def test_a_file_over_the_limit_is_not_read(tmp_path):
    path = tmp_path / "sparse"
    with path.open("wb") as file:
        file.truncate(2**42)
    with pytest.raises(InputError, match=r"sparse: larger than 64 MiB"):
        read_bytes(path)
    path.write_bytes(b"12345")
    assert read_bytes(path, limit=5) == b"12345"
    with pytest.raises(InputError, match="larger"):
        read_bytes(path, limit=4)


@pytest.mark.parametrize("name", ["missing", "a\0b", "x" * 300])
def test_what_is_not_there_is_named(tmp_path, name):
    with pytest.raises(InputError, match=r"no such file|cannot be read|no file can have this name"):
        read_text(tmp_path / name)


@pytest.mark.parametrize("content", [b"\xff\xfe1\x00", b"1 2\x003", b"\xc3"])
def test_bytes_are_no_text(tmp_path, content):
    path = tmp_path / "bytes.txt"
    path.write_bytes(content)
    with pytest.raises(InputError, match="not a text file"):
        read_text(path)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "line 1: not valid JSON"),
        ("[1,\n}", "line 2: not valid JSON"),
        ("NaN", "NaN is not a number"),
        ("[-Infinity]", "-Infinity is not a number"),
        ("1e999", "1e999 is too large"),
        ("9" * 5000, "more than 15 digits"),
        ('{"a": 1, "a": 2}', '"a" stands there twice'),
        ("[" * 100_000, "nested too deeply"),
        ("[" * 150 + "]" * 150, "nested too deeply"),
        ("", "line 1"),
    ],
)
def test_what_is_no_json_is_refused_in_one_line(tmp_path, text, reason):
    path = tmp_path / "report.json"
    path.write_text(text)
    with pytest.raises(InputError) as refusal:
        read_json(path)
    assert "report.json" in str(refusal.value)
    assert reason in str(refusal.value)
    assert "\n" not in str(refusal.value)


_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(1 - 10**15, 10**15 - 1)
    | st.floats(-1e9, 1e9)
    | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=20,
)


@given(value=_values)
def test_any_value_is_read_as_it_was_written(tmp_path_factory, value):
    path = tmp_path_factory.mktemp("json") / "value.json"
    path.write_text(json.dumps(value))
    assert read_json(path) == value


def test_a_folder_does_not_reach_out_of_itself(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    (tmp_path / "secret").write_text("secret")
    (folder / "link").symlink_to(tmp_path / "secret")
    (folder / "circle").symlink_to(folder / "circle")
    (folder / "log").write_text("log")
    (folder / "same").symlink_to("log")
    assert read_text(path_inside(folder, "log")) == "log"
    assert read_text(path_inside(folder, "same")) == "log"
    for name in ("link", "../secret", tmp_path / "secret", "circle/x"):
        with pytest.raises(InputError, match="leads out of its folder"):
            path_inside(folder, name)


def test_a_folder_that_is_a_link_itself_is_read(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "log").write_text("log")
    (tmp_path / "latest").symlink_to("run")
    assert read_text(path_inside(tmp_path / "latest", "log")) == "log"
