"""Motion-capture exports: CSV of OptiTrack Motive, and of Vicon Nexus or Tracker."""

from dataclasses import replace

from pepper_drake.errors import InputError
from pepper_drake.learning.demonstrations.importers.options import LENGTHS
from pepper_drake.learning.demonstrations.importers.table import Table, number, numbers
from pepper_drake.learning.demonstrations.importers.track import Track

_MOTIVE_UNITS = {
    "millimeters": "mm",
    "millimetres": "mm",
    "centimeters": "cm",
    "centimetres": "cm",
    "meters": "m",
    "metres": "m",
    "inches": "in",
}
_VICON_TITLES = ("trajectories", "objects", "segments", "global trajectories")
_VICON_OTHERS = ("devices", "joints", "model outputs", "events")


def is_motive(table: Table) -> bool:
    """Tells whether a table is Motive's: its first row gives the format's version."""
    return bool(table.rows) and table.rows[0][0].lower() == "format version"


def is_vicon(table: Table) -> bool:
    """Tells whether a table is Vicon's: a section's title, the rate, names, `Frame, Sub Frame`."""
    return (
        len(table.rows) > 3
        and table.rows[0][0].lower() in (*_VICON_TITLES, *_VICON_OTHERS)
        and any(row[0].lower() == "frame" for row in table.rows[1:5])
    )


def _trajectories(table: Table) -> Table:
    """Returns the part of Vicon's export with the positions of objects or markers."""
    titles = [
        k
        for k, row in enumerate(table.rows)
        if row[0].lower() in (*_VICON_TITLES, *_VICON_OTHERS) and not any(row[1:])
    ]
    for start, end in zip(titles, [*titles[1:], len(table.rows)], strict=True):
        if table.rows[start][0].lower() in _VICON_TITLES:
            return replace(table, rows=table.rows[start:end], lines=table.lines[start:end])
    raise InputError(
        f"{table.path}: Vicon's {table.rows[0][0]} without Trajectories; export those of the"
        " markers or objects"
    )


def read_motive(table: Table) -> list[Track]:
    """Reads Motive's export: one track for each rigid body, or for each marker.

    Raises:
        InputError: The header is broken, or it holds no motion.
    """
    path = table.path
    head = [i for i, row in enumerate(table.rows[:20]) if row[0].lower() == "frame"]
    if not head:
        raise InputError(f"{path}: Motive's header, but no row that begins with Frame")
    start = head[0]
    fields = dict(zip(table.rows[0][::2], table.rows[0][1::2], strict=False))
    lower = {key.lower(): value for key, value in fields.items()}
    unit = _MOTIVE_UNITS.get(lower.get("length units", "").lower())
    quaternions = lower.get("rotation type", "quaternion").lower() == "quaternion"
    rows = {_label(row): row for row in table.rows[1:start]}
    kinds, names, axes = rows.get("type", ()), rows.get("name", ()), table.rows[start]
    values = table.rows[start - 1]  # Rotation or Position.
    columns: dict[tuple[str, str], dict[str, int]] = {}
    for i in range(2, len(axes)):
        value = values[i].lower() if i < len(values) else ""
        if value in ("rotation", "position") and i < len(names):
            key = (kinds[i].lower() if i < len(kinds) else "", names[i])
            columns.setdefault(key, {}).setdefault(f"{value} {axes[i].lower()}", i)
    bodies = {key: c for key, c in columns.items() if key[0] == "rigid body"} or columns
    notes: tuple[str, ...] = (
        "Motive's positions are in its own frame, whose y axis points up unless it was exported"
        " otherwise (up: y)",
    )
    tracks = []
    for (_, name), found in bodies.items():
        place = [found.get(f"position {axis}") for axis in "xyz"]
        turn = [found.get(f"rotation {axis}") for axis in "wxyz"]
        if None in place:
            continue
        turned = quaternions and None not in turn
        used = [1, *place, *(turn if turned else [])]
        data, lines, empty = numbers(table, start + 1, [c for c in used if c is not None])
        said: tuple[str, ...] = notes
        if empty:
            said = (*said, f"{name} was not seen in {len(empty)} rows, first in line {empty[0]}")
        if not quaternions and "rotation x" in found:
            said = (*said, "angles of Motive may be in any order; the orientation was left out")
        tracks.append(
            Track(
                path,
                path.stem if len(bodies) == 1 else f"{path.stem}_{name}",
                "OptiTrack Motive",
                data[:, 0],
                data[:, 1:4],
                rotations=data[:, 4:8] if turned else None,
                quaternion="wxyz" if turned else None,
                time_unit="s",
                unit=unit,
                lines=lines,
                notes=said,
            )
        )
    if not tracks:
        raise InputError(f"{path}: Motive's export without a position of a rigid body or marker")
    return tracks


def read_vicon(table: Table) -> list[Track]:
    """Reads Vicon's export: one track for each object or marker.

    Raises:
        InputError: The header is broken, or it holds no motion.
    """
    path, table = table.path, _trajectories(table)
    if len(table.rows) < 4:
        raise InputError(f"{path}: Vicon's {table.rows[0][0]} is empty; export it again")
    rate = number(table.rows[1][0], f"{path}, line {table.lines[1]}") if table.rows[1][0] else 0.0
    if not 0.0 < rate < 1e6:
        raise InputError(
            f"{path}, line {table.lines[1]}: {rate:g} is not a rate; Vicon writes the frames a"
            " second there"
        )
    heads = [i for i, row in enumerate(table.rows[:6]) if row[0].lower() == "frame"]
    if not heads:
        raise InputError(f"{path}, line {table.lines[0]}: no row Frame, Sub Frame below it")
    head = heads[0]
    axes = [word.lower() for word in table.rows[head]]
    names = list(table.rows[head - 1]) if head > 2 else []
    names += [""] * (len(axes) - len(names))
    for i in range(1, len(names)):
        names[i] = names[i] or names[i - 1]
    units = table.rows[head + 1] if head + 1 < len(table.rows) else ()
    groups: dict[str, dict[str, int]] = {}
    for i, axis in enumerate(axes[2:], start=2):
        groups.setdefault(names[i], {}).setdefault(axis, i)
    tracks = []
    for name, found in groups.items():
        place = [found.get(f"t{axis}", found.get(axis)) for axis in "xyz"]
        if None in place:
            continue
        turn = [found.get(f"r{axis}") for axis in "wxyz"]
        turned = None not in turn
        used = [c for c in (0, 1, *place, *(turn if turned else [])) if c is not None]
        data, lines, empty = numbers(table, head + 2, used)
        unit = units[used[2]].lower() if used[2] < len(units) else ""
        frames = data[:, 0] * (data[:, 1].max(initial=0.0) + 1.0) + data[:, 1]
        notes: tuple[str, ...] = ()
        if empty:
            notes = (f"{name} was not seen in {len(empty)} rows, first in line {empty[0]}",)
        if not turned and "rx" in found:
            notes = (*notes, "rx, ry, rz without rw: the orientation was left out")
        tracks.append(
            Track(
                path,
                path.stem if len(groups) == 1 else f"{path.stem}_{_tidy(name)}",
                "Vicon",
                (frames - (frames[0] if len(frames) else 0.0)) / rate,
                data[:, 2:5],
                rotations=data[:, 5:9] if turned else None,
                quaternion="wxyz" if turned else None,
                time_unit="s",
                unit=unit if unit in LENGTHS else None,
                lines=lines,
                notes=notes,
            )
        )
    if not tracks:
        raise InputError(f"{path}: Vicon's export without a position of an object or marker")
    return tracks


def _label(row: tuple[str, ...]) -> str:
    return next((word.lower() for word in row if word), "")


def _tidy(name: str) -> str:
    return name.replace(":", "_") or "marker"
