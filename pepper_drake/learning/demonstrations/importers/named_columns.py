"""Tables whose columns have names: CSV, TUM and evo, EuRoC, `rostopic echo -p`, joint logs."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.demonstrations.importers.headers import (
    UNKNOWN,
    Meaning,
    is_command,
    meaning,
    unit_words,
)
from pepper_drake.learning.demonstrations.importers.options import LENGTHS, TIMES
from pepper_drake.learning.demonstrations.importers.table import (
    Table,
    is_number,
    numbers,
    shorten,
    split,
)
from pepper_drake.learning.demonstrations.importers.track import Track

Array = npt.NDArray[np.float64]
Lines = npt.NDArray[np.int64]
ReadColumns = Callable[[Sequence[int]], tuple[Array, Lines | None, list[int]]]
"""Returns the values (N, K) of K columns, their rows' lines (N,) or None where there are no lines,
and the lines of rows without values."""

_SIZES = {
    "position": 3,
    "velocity": 3,
    "acceleration": 3,
    "quaternion": 4,
    "angle": 3,
    "rotation_vector": 3,
}
_LABELS = {
    "trial", "episode", "episode_index", "demo", "demonstration", "take", "rep", "repetition",
    "body", "object", "rigid_body", "rigidbody", "marker", "subject", "child_frame_id",
}  # fmt: skip
"""Columns that label the motion of a row."""

_MOST_PARTS = 1000

_SECOND_PARTS = {
    "nsec": 1e-9, "nsecs": 1e-9, "nanosec": 1e-9, "nanosecs": 1e-9, "nanoseconds": 1e-9,
    "usec": 1e-6, "usecs": 1e-6, "microsec": 1e-6,
}  # fmt: skip


def find_header(table: Table) -> tuple[list[str], int] | None:
    """Returns the columns' names and the first row of data, or None where there are no names.

    The header is the nearest row above the data that contains a known name, or else the last
    comment before the data with one name per column, all of them known or time and position among
    them. A row of units below the names is joined to them.
    """
    start = first_data(table)
    if start is None:
        return (list(table.rows[0]), 1) if table.rows and len(table.rows[0]) > 1 else None
    above = start
    units: tuple[str, ...] = ()
    if start > 1 and unit_words(table.rows[start - 1]):
        units, above = table.rows[start - 1], start - 1
    width = len(table.rows[start])
    for row in reversed(table.rows[:above]):
        num_known = sum(meaning(word) is not None for word in row)
        fits = len(row) in (width - 1, width)
        # Words separated by blanks may be a sentence.
        if num_known and len(row) > 1 and (fits or (num_known > 1 and table.separator != " ")):
            return _with_units(row, units), start
    if start and len(table.rows[start - 1]) == width:
        return list(table.rows[start - 1]), start  # Names, but none is known.
    line = table.lines[start]
    for number, comment in reversed(table.comments):
        if number > line:
            continue
        for words in (
            [word.strip() for word in comment.split(",")],
            [word.strip() for word in comment.split(";")],
            split(comment, " "),
        ):
            known = [m for word in words if (m := meaning(word)) is not None]
            # A sentence has few known words; a header names time and position.
            if len(words) == width and (
                len(known) == len(words) or {"time", "position"} <= {m.kind for m in known}
            ):
                return list(words), start
    return None


def first_data(table: Table) -> int | None:
    """Returns the first row of which at least half of the words are numbers."""
    for i, row in enumerate(table.rows):
        words = [word for word in row if word]
        if 2 * sum(is_number(word) for word in words) >= len(words):
            return i
    return None


def _with_units(names: Sequence[str], units: Sequence[str]) -> list[str]:
    bare = [unit.strip("[]() ") for unit in units] + [""] * len(names)
    return [
        f"{name} [{unit}]" if unit and "[" not in name else name
        for name, unit in zip(names, bare, strict=False)
    ]


def read_named_columns(table: Table, names: list[str], first: int) -> list[Track]:
    """Reads a table with named columns, in any order; one track for each body in it.

    Args:
        table: The table.
        names: Names of the columns.
        first: The first row with data.

    Raises:
        InputError: It holds no motion, or a row is broken.
    """
    path = table.path
    rows = [
        (row, line)
        for row, line in zip(table.rows[first:], table.lines[first:], strict=True)
        if not first or row != table.rows[first - 1]  # Not a repeated header.
    ]
    if not rows:
        raise InputError(f"{path}: a header without rows of numbers below it")
    more = sum(map(bool, rows[0][0])) - len(names)
    if more > 0:
        raise InputError(
            f"{path}, line {rows[0][1]}: {len(names) + more} columns where {len(names)} are named;"
            " name each, and write numbers with a decimal point (or semicolons between columns)"
        )
    parts = _parts(names, rows)
    if len(parts) == 1:
        return _read_one(replace(table, rows=tuple(r for r, _ in rows),
                                 lines=tuple(line for _, line in rows)), names)  # fmt: skip
    tracks = []
    for label, part in parts.items():
        own = replace(table, rows=tuple(r for r, _ in part), lines=tuple(line for _, line in part))
        tracks += [replace(track, name=f"{track.name}_{label}") for track in _read_one(own, names)]
    return tracks


def _parts(
    names: Sequence[str], rows: list[tuple[tuple[str, ...], int]]
) -> dict[str, list[tuple[tuple[str, ...], int]]]:
    """Returns the rows by motion, where a column labels the motion of each row."""
    for i, name in enumerate(names):
        if re.split(r"[./ ]", name.strip().lower())[-1] in _LABELS:
            parts: dict[str, list[tuple[tuple[str, ...], int]]] = {}
            for row, line in rows:
                parts.setdefault(row[i] if i < len(row) else "", []).append((row, line))
            if 1 < len(parts) <= _MOST_PARTS:
                return parts
    return {"": rows}


def _read_one(table: Table, names: list[str]) -> list[Track]:
    path, top = table.path, f"{table.path}, line {table.lines[0]}"
    table, names = _with_seconds(table, _names_in_rows(names, table.rows[0]))
    decimal_comma = table.separator != "," and any("," in word for word in table.rows[0])
    tracks = tracks_of_columns(
        path, top, names, lambda columns: numbers(table, 0, columns, decimal_comma)
    )
    if not tracks:
        shown = ", ".join(shorten(name) for name in names[:8])
        raise InputError(
            f"{top}: no motion among the columns {shown}; a position is named x, y, z, a joint as"
            " NAOqi names it, and a line that is neither names nor numbers begins with #"
        )
    time, absolute = _time_column([meaning(name) for name in names])
    frame = _frame(names, table.rows[0])
    tracks = [replace(track, absolute=absolute, frame=frame) for track in tracks]
    if time in table.clocks:
        tracks = [replace(track, time_unit="s") for track in tracks]
    return tracks


def tracks_of_columns(
    path: Path, where: str, names: Sequence[str], read: ReadColumns
) -> list[Track]:
    """Returns the motions in named columns, one per body; joints join a single body.

    Args:
        path: The file.
        where: Place of the names, for messages.
        names: Names of the columns.
        read: Reads the columns of given indices.

    Raises:
        InputError: Columns contradict each other, or their content is broken.
    """
    found = [meaning(name) for name in names]
    for name, m in zip(names, found, strict=True):
        if m is not None and m.unit is not None and m.unit.startswith(UNKNOWN):
            raise InputError(
                f"{where}: the unit of {shorten(name)} is not read; give lengths in"
                f" {', '.join(LENGTHS)}, angles in rad or deg, times in {', '.join(TIMES)}"
            )
    time, _ = _time_column(found)
    unit = None if time is None else _time_unit(names, found, time)
    try:
        groups = _groups(names, found)
        joints = _joint_columns(names, found)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    tracks = []
    for group, columns in groups.items():
        track = _body(read, time, columns, path, found)
        name = path.stem if not group or len(groups) == 1 else f"{path.stem}_{group}"
        tracks.append(replace(track, name=name))
    if joints:
        joined = _joints(read, time, joints, path)
        if len(tracks) == 1 and tracks[0].num_samples == joined.num_samples:
            tracks = [
                replace(
                    tracks[0],
                    joints=joined.joints,
                    joint_names=joined.joint_names,
                    joint_unit=joined.joint_unit,
                )
            ]
        elif not tracks:
            tracks = [joined]
    used = {
        time,
        *joints,
        *(i for columns in groups.values() for at in columns.values() for i in at),
    }
    notes = _notes(names, found, used)
    return [replace(track, time_unit=unit, notes=(*notes, *track.notes)) for track in tracks]


def _with_seconds(table: Table, names: list[str]) -> tuple[Table, list[str]]:
    """Returns the table with a time column added where seconds and their fraction have two."""
    lower = [re.split(r"[._/ ]", name.strip("\"' ").lower()) for name in names]
    for i, words in enumerate(lower):
        if words[-1] not in ("sec", "secs"):
            continue
        for j, others in enumerate(lower):
            if others[:-1] == words[:-1] and others[-1] in _SECOND_PARTS:
                scale = _SECOND_PARTS[others[-1]]
                rows = tuple((*row, _seconds(row, i, j, scale)) for row in table.rows)
                kept = ["" if k in (i, j) else name for k, name in enumerate(names)]
                return replace(table, rows=rows), [*kept, "header.time [s]"]
    return table, names


def _seconds(row: Sequence[str], i: int, j: int, scale: float) -> str:
    try:
        return f"{float(row[i]) + scale * float(row[j]):.9f}"
    except (ValueError, IndexError):
        return row[i] if i < len(row) else ""


def _names_in_rows(names: list[str], row: tuple[str, ...]) -> list[str]:
    """Returns the header with joint names from the rows filled in, as rostopic writes these."""
    lower = [name.strip().lower() for name in names]
    result = list(names)
    for i, name in enumerate(lower):
        stem, number = name.rstrip("0123456789"), name[len(name.rstrip("0123456789")) :]
        if stem.endswith("name") and number and i < len(row):
            position = stem.removesuffix("name") + "position" + number
            if position in lower:
                result[lower.index(position)] = row[i].strip("\"'")
                result[i] = "joint_label"
    return result


def _time_column(found: list[Meaning | None]) -> tuple[int | None, bool]:
    """Returns the time column, and whether it may hold a clock's time."""
    times = [i for i, m in enumerate(found) if m is not None and m.kind == "time"]
    if not times:
        return None, False
    stamped = [i for i in times if "header" in (found[i] or Meaning("")).group]
    return (stamped or times)[0], True


def _time_unit(names: Sequence[str], found: list[Meaning | None], time: int) -> str | None:
    known = found[time]
    if known is not None and known.unit is not None:
        return known.unit
    lower = [name.strip().lower() for name in names]
    if lower[0] == "%time" or lower[time].endswith("header.stamp"):
        return "ns"  # As rostopic echo -p writes them.
    if lower[time].strip("#% ") in ("secs", "seconds", "sec"):
        return "s"
    return None


def _frame(names: list[str], row: tuple[str, ...]) -> str | None:
    for i, name in enumerate(names):
        is_frame = re.fullmatch(r"(.*[._])?frame_id", name.strip().lower()) and "child" not in name
        if is_frame and i < len(row) and row[i]:
            return row[i].strip("\"'/")
    return None


def _groups(names: Sequence[str], found: list[Meaning | None]) -> dict[str, dict[str, list[int]]]:
    """Returns the columns of each body with a complete position: kind of value, axes."""
    groups: dict[str, dict[str, dict[int, int]]] = {}
    for i, m in enumerate(found):
        if m is not None and m.kind in _SIZES:
            axes = groups.setdefault(m.group, {}).setdefault(m.kind, {})
            if m.axis in axes and m.kind == "position":
                raise InputError(
                    f"columns {shorten(names[axes[m.axis]])} and {shorten(names[i])} both are the"
                    f" position's {'xyz'[m.axis]}; name a quaternion's columns qx, qy, qz, qw, and"
                    " put another body's name before its columns (cup_x)"
                )
            axes.setdefault(m.axis, i)
    # A velocity or an angle without a body's name belongs to the only body.
    bodies = [name for name, kinds in groups.items() if "position" in kinds]
    bodies = [name for name in bodies if not is_command(name)] or bodies
    if len(bodies) == 1:
        for name in [name for name in groups if name != bodies[0] and not is_command(name)]:
            for kind, axes in groups.pop(name).items():
                groups[bodies[0]].setdefault(kind, axes)
    result = {}
    for name in bodies:
        kinds = groups[name]
        place = kinds["position"]
        dimensions = [axis for axis in range(3) if axis in place]
        if dimensions != list(range(len(dimensions))):
            continue
        columns = {"position": [place[axis] for axis in dimensions]}
        for kind in ("velocity", "acceleration"):
            if all(axis in kinds.get(kind, {}) for axis in dimensions):
                columns[kind] = [kinds[kind][axis] for axis in dimensions]
        if 0 < len(kinds.get("quaternion", {})) < 4:
            raise InputError(
                f"a quaternion with {len(kinds['quaternion'])} columns; name all four (qw, qx, qy,"
                " qz), or none; angles are named roll, pitch, yaw"
            )
        if len(kinds.get("quaternion", {})) == 4:
            columns["quaternion"] = [kinds["quaternion"][axis] for axis in (3, 0, 1, 2)]
        if len(kinds.get("angle", {})) == 3:
            columns["angle"] = [kinds["angle"][axis] for axis in range(3)]
        result[name] = columns
    return result


def _joint_columns(names: Sequence[str], found: list[Meaning | None]) -> dict[int, Meaning]:
    joints = {i: m for i, m in enumerate(found) if m is not None and m.kind == "joint"}
    first: dict[str, int] = {}
    for i, m in joints.items():
        if first.setdefault(m.joint, i) != i:
            raise InputError(
                f"columns {shorten(names[first[m.joint]])} and {shorten(names[i])} both are"
                f" {m.joint}; leave out one"
            )
    return joints


def _body(
    read: ReadColumns,
    time: int | None,
    columns: Mapping[str, list[int]],
    path: Path,
    found: list[Meaning | None],
) -> Track:
    used = [*([] if time is None else [time])]
    parts: dict[str, slice] = {}
    for kind, places in columns.items():
        parts[kind] = slice(len(used), len(used) + len(places))
        used += places
    values, lines, empty = read(used)
    first_of = {kind: found[places[0]] for kind, places in columns.items()}
    notes = []
    if empty:
        notes.append(
            f"{len(empty)} rows without values were left out, the first in line {empty[0]}"
        )

    def part(kind: str) -> Array | None:
        return values[:, parts[kind]] if kind in parts else None

    def unit(kind: str) -> str | None:
        m = first_of.get(kind)
        return None if m is None else m.unit

    units = {m.unit for i in columns["position"] if (m := found[i]) is not None}
    if len(units) > 1:
        raise InputError(
            f"{path}: x, y and z are in different units ({', '.join(sorted(map(str, units)))});"
            " give them in one"
        )
    rotations = part("quaternion")
    return Track(
        path,
        path.stem,
        "table with named columns",
        None if time is None else values[:, 0],
        part("position"),
        part("velocity") if unit("velocity") in (None, unit("position")) else None,
        part("acceleration") if unit("acceleration") in (None, unit("position")) else None,
        rotations=rotations,
        angles=None if rotations is not None else part("angle"),
        unit=unit("position"),
        angle_unit=unit("angle"),
        quaternion=None if rotations is None else "wxyz",
        lines=lines,
        notes=tuple(notes),
    )


def _joints(
    read: ReadColumns, time: int | None, joints: Mapping[int, Meaning], path: Path
) -> Track:
    used = [*([] if time is None else [time]), *joints]
    values, lines, _ = read(used)
    units = {m.unit for m in joints.values() if m.unit is not None}
    return Track(
        path,
        path.stem,
        "table of joints",
        None if time is None else values[:, 0],
        joints=values[:, 1:] if time is not None else values,
        joint_names=tuple(m.joint for m in joints.values()),
        joint_unit=units.pop() if len(units) == 1 else None,
        lines=lines,
    )


def _notes(
    names: Sequence[str], found: list[Meaning | None], used: set[int | None]
) -> tuple[str, ...]:
    notes = []
    other = [
        name for name, m in zip(names, found, strict=True) if m is None and "joint" in name.lower()
        and name not in ("joint_label",)
    ]  # fmt: skip
    if other:
        notes.append(
            f"{len(other)} columns are joints of another robot ({shorten(other[0])}) and were left"
            " out"
        )
    if any(m is not None and m.kind == "rotation_vector" for m in found):
        notes.append(
            "columns rx, ry, rz may be a rotation vector or angles; the orientation was left out"
        )
    unread = [
        name
        for i, (name, m) in enumerate(zip(names, found, strict=True))
        if i not in used and name not in ("", "joint_label", *other)
        and (m is None or m.kind not in ("time", "rotation_vector"))
    ]  # fmt: skip
    if unread:
        shown = ", ".join(shorten(name) for name in unread[:4])
        notes.append(f"{len(unread)} columns were not read: {shown}")
    return tuple(notes)
