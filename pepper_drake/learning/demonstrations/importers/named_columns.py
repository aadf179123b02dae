"""Tables whose columns have names: CSV, TUM and evo, EuRoC, `rostopic echo -p`, joint logs."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.demonstrations.importers.headers import Meaning, meaning
from pepper_drake.learning.demonstrations.importers.table import (
    Table,
    is_number,
    numbers,
    shorten,
)
from pepper_drake.learning.demonstrations.importers.track import Track

Array = npt.NDArray[np.float64]

_SIZES = {
    "position": 3,
    "velocity": 3,
    "acceleration": 3,
    "quaternion": 4,
    "angle": 3,
    "rotation_vector": 3,
}
_FRAME_COLUMNS = ("frame_id", "child_frame_id")


def find_header(table: Table) -> tuple[list[str], int] | None:
    """Returns the names of the columns and how many rows are no data, None where none are named.

    The names are the first row, or the last comment before the data that has as many names as
    there are columns, all of them known, or time and position among them.
    """
    if not table.rows:
        return None
    first = table.rows[0]
    if not all(is_number(word) for word in first if word) and len(first) > 1:
        return list(first), 1
    start = table.lines[0]
    for line, comment in reversed(table.comments):
        if line > start:
            continue
        for words in (
            [word.strip() for word in comment.split(",")],
            [word.strip() for word in comment.split(";")],
            comment.split(),
        ):
            known = [m for word in words if (m := meaning(word)) is not None]
            # A comment in words has few of them; a header names the time and the position.
            if len(words) == len(first) and (
                len(known) == len(words) or {"time", "position"} <= {m.kind for m in known}
            ):
                return words, 0
    return None


def read_named_columns(table: Table, names: list[str], first: int) -> list[Track]:
    """Reads a table with named columns, in any order; one track for each body in it.

    Args:
        table: The words.
        names: Of the columns.
        first: The first row with data.

    Raises:
        InputError: There is no motion in it, or a row is broken.
    """
    path = table.path
    if len(table.rows) <= first:
        raise InputError(f"{path}: a header without rows of numbers below it")
    names = _names_in_rows(names, table.rows[first])
    found = [meaning(name) for name in names]
    decimal_comma = table.separator in (";", "\t", " ") and any(
        "," in word for word in table.rows[first]
    )
    time, absolute = _time_column(found)
    unit = None if time is None else _time_unit(names, found, time)
    frame = _frame(names, table.rows[first])
    try:
        groups = _groups(found)
    except InputError as error:
        raise InputError(f"{path}, line {table.lines[0]}: {error}") from None
    joints = {i: m for i, m in enumerate(found) if m is not None and m.kind == "joint"}
    notes = _notes(names, found)
    tracks = []
    for group, columns in groups.items():
        track = _body(table, first, decimal_comma, time, columns, path, found)
        name = path.stem if not group or len(groups) == 1 else f"{path.stem}_{group}"
        tracks.append(
            replace(
                track,
                name=name,
                time_unit=unit,
                frame=frame,
                absolute=absolute,
                notes=(*notes, *track.notes),
            )
        )
    if joints:
        joined = _joints(table, first, decimal_comma, time, joints)
        joined = replace(joined, time_unit=unit, absolute=absolute, notes=notes)
        if len(tracks) == 1 and tracks[0].num_samples == joined.num_samples:
            joined = replace(
                tracks[0],
                joints=joined.joints,
                joint_names=joined.joint_names,
                joint_unit=joined.joint_unit,
            )
            tracks = [joined]
        elif not tracks:
            tracks = [joined]
    if not tracks:
        shown = ", ".join(shorten(name) for name in names[:8])
        raise InputError(
            f"{path}, line {table.lines[0]}: no motion among the columns {shown}; a position is"
            " named x, y, z, a joint as NAOqi names it"
        )
    return tracks


def _names_in_rows(names: list[str], row: tuple[str, ...]) -> list[str]:
    """Returns the header with joint names in it where the rows hold these, as rostopic writes."""
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
    """Returns the column with the time, and whether it may be a clock's."""
    times = [i for i, m in enumerate(found) if m is not None and m.kind == "time"]
    if not times:
        return None, False
    stamped = [i for i in times if "header" in (found[i] or Meaning("")).group]
    return (stamped or times)[0], True


def _time_unit(names: list[str], found: list[Meaning | None], time: int) -> str | None:
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
        if name.strip().lower().split(".")[-1] == "frame_id" and i < len(row) and row[i]:
            return row[i].strip("\"'/")
    return None


def _groups(found: list[Meaning | None]) -> dict[str, dict[str, list[int]]]:
    """Returns, for each body that has a whole position: kind of value, columns by axis."""
    groups: dict[str, dict[str, dict[int, int]]] = {}
    for i, m in enumerate(found):
        if m is not None and m.kind in _SIZES:
            axes = groups.setdefault(m.group, {}).setdefault(m.kind, {})
            axes.setdefault(m.axis, i)
    # A velocity or an angle whose name has no body belongs to the only body there is.
    bodies = [name for name, kinds in groups.items() if "position" in kinds]
    if len(bodies) == 1:
        for name in [name for name in groups if name != bodies[0]]:
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
                f"a quaternion with {len(kinds['quaternion'])} columns; name all four, or none"
            )
        if len(kinds.get("quaternion", {})) == 4:
            columns["quaternion"] = [kinds["quaternion"][axis] for axis in (3, 0, 1, 2)]
        if len(kinds.get("angle", {})) == 3:
            columns["angle"] = [kinds["angle"][axis] for axis in range(3)]
        result[name] = columns
    return result


def _body(
    table: Table,
    first: int,
    decimal_comma: bool,
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
    values, lines, empty = numbers(table, first, used, decimal_comma)
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
    table: Table,
    first: int,
    decimal_comma: bool,
    time: int | None,
    joints: Mapping[int, Meaning],
) -> Track:
    used = [*([] if time is None else [time]), *joints]
    values, lines, _ = numbers(table, first, used, decimal_comma)
    units = {m.unit for m in joints.values() if m.unit is not None}
    return Track(
        table.path,
        table.path.stem,
        "table of joints",
        None if time is None else values[:, 0],
        joints=values[:, 1:] if time is not None else values,
        joint_names=tuple(m.joint for m in joints.values()),
        joint_unit=units.pop() if len(units) == 1 else None,
        lines=lines,
    )


def _notes(names: list[str], found: list[Meaning | None]) -> tuple[str, ...]:
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
    return tuple(notes)
