"""Detects a file's format by its content, and calls its reader."""

from dataclasses import replace
from pathlib import Path

from pepper_drake.errors import InputError
from pepper_drake.learning.demonstrations.importers.bags import is_bag, read_bag
from pepper_drake.learning.demonstrations.importers.choregraphe import (
    is_exported_python,
    read_exported_python,
    read_timeline,
)
from pepper_drake.learning.demonstrations.importers.lasa import read_lasa
from pepper_drake.learning.demonstrations.importers.lerobot import is_dataset, read_dataset
from pepper_drake.learning.demonstrations.importers.motion_capture import (
    is_motive,
    is_vicon,
    read_motive,
    read_vicon,
)
from pepper_drake.learning.demonstrations.importers.named_columns import (
    find_header,
    first_data,
    read_named_columns,
)
from pepper_drake.learning.demonstrations.importers.number_columns import read_number_columns
from pepper_drake.learning.demonstrations.importers.stated_units import with_comments
from pepper_drake.learning.demonstrations.importers.table import (
    check_file,
    parse_words,
    read_table_text,
)
from pepper_drake.learning.demonstrations.importers.track import Track
from pepper_drake.learning.demonstrations.importers.unsupported_formats import (
    refuse_code,
    refuse_foreign,
)


def read_tracks(path: Path) -> list[Track]:
    """Reads all motions of another tool's file or folder.

    Raises:
        InputError: With file, line and what to do.
    """
    check_file(path)
    if is_dataset(path):
        return read_dataset(path)
    if is_bag(path):
        return read_bag(path)
    if path.is_dir():
        raise InputError(
            f"{path}: no recording that is known: a folder has translation.txt or joints.csv, a"
            " bag's metadata.yaml, or LeRobot's meta/info.json"
        )
    refuse_foreign(path)
    if path.suffix == ".mat":
        return read_lasa(path)
    return _read_text(path)


def _read_text(path: Path) -> list[Track]:
    text = read_table_text(path)
    start = text.lstrip()[:200]
    if start.startswith("<"):
        return read_timeline(path, text)
    if is_exported_python(text):
        return read_exported_python(path, text)
    refuse_code(path)
    table = parse_words(path, text)
    if not table.rows:
        raise InputError(f"{path}: 0 rows of numbers; a motion needs at least 4")
    if is_motive(table):
        return read_motive(table)
    if is_vicon(table):
        return read_vicon(table)
    header = find_header(table)
    first = header[1] if header is not None else first_data(table) or 0
    titles = [(line, " ".join(row)) for row, line in zip(table.rows, table.lines, strict=True)]
    if header is not None:
        tracks = read_named_columns(table, *header)
    else:
        tracks = read_number_columns(
            replace(table, rows=table.rows[first:], lines=table.lines[first:])
        )
    return with_comments(tracks, (*table.comments, *titles[:first]))
