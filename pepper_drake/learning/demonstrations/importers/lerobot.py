"""LeRobot datasets (v2 and v3): the state columns of parquet files, a track per episode.

`pyarrow` reads them; it is an extra: pip install "pepper-drake[formats]".
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from pepper_drake.errors import InputError
from pepper_drake.files import path_inside, read_text
from pepper_drake.learning.demonstrations.importers.bags import EXTRA
from pepper_drake.learning.demonstrations.importers.named_columns import tracks_of_columns
from pepper_drake.learning.demonstrations.importers.table import (
    LARGEST_NUMBER,
    check_file,
    shorten,
)
from pepper_drake.learning.demonstrations.importers.track import Track

STATE = "observation.state"

_MOST_ROWS = 2_000_000
_MOST_FILES = 1000
_MOST_VALUES = 8_000_000
"""Largest number of values in a file: about a hundred bytes each in memory."""


def is_dataset(path: Path) -> bool:
    """Tells whether a folder is a LeRobot dataset, or a file one of its tables."""
    return path.suffix == ".parquet" or (path / "meta" / "info.json").is_file()


def read_dataset(path: Path) -> list[Track]:
    """Reads the episodes of a dataset.

    Raises:
        InputError: pyarrow is missing, a file is broken, or the state has no known names.
    """
    root = path if path.is_dir() else _root_of(path)
    names, rate = _features(root, path)
    files = sorted((path / "data").rglob("*.parquet"))[:_MOST_FILES] if path.is_dir() else [path]
    if not files:
        raise InputError(f"{path}: a LeRobot dataset without parquet files in data/")
    episodes: dict[int, list[tuple[float, Any]]] = {}
    for file in files:
        check_file(path_inside(root, file.resolve()) if path.is_dir() else file)
        for episode, time, state in _rows(file, rate):
            episodes.setdefault(episode, []).append((time, state))
    tracks = [
        track
        for number, rows in sorted(episodes.items())
        if len(rows) >= 4
        for track in _tracks(path, f"{root.name or path.stem}_{number}", rows, names)
    ]
    if not tracks:
        raise InputError(f"{path}: no episode of four samples or more in it")
    return tracks


def _root_of(file: Path) -> Path:
    for folder in file.resolve().parents[:4]:
        if (folder / "meta" / "info.json").is_file():
            return folder
    raise InputError(
        f"{file}: a parquet file alone does not tell what its columns are; give the dataset's"
        " folder, which has meta/info.json"
    )


def _features(root: Path, path: Path) -> tuple[list[str], float]:
    info = path_inside(root, "meta/info.json")
    try:
        check_file(info)
        data = json.loads(read_text(info))
        feature = data["features"][STATE]
        names = _flat(feature["names"])
        rate = float(data["fps"])
        if not 0.0 < rate < 1e6:
            raise ValueError(f"fps is {rate}")
        return names, rate
    except InputError:
        raise
    except (ValueError, KeyError, TypeError, StopIteration, RecursionError, OverflowError) as error:
        raise InputError(
            f"{info}: it must give fps and features.{STATE}.names ({type(error).__name__}:"
            f" {str(error)[:80]})"
        ) from None


def _flat(names: Any) -> list[str]:
    """Names of columns in order, flattened from groups such as {"motors": [...]} or [[...]]."""
    if isinstance(names, str):
        return [names]
    groups = names.values() if isinstance(names, dict) else names
    return [name for group in groups for name in _flat(group)]


def _rows(file: Path, rate: float) -> list[tuple[int, float, Any]]:
    try:
        import pyarrow.parquet as parquet
    except ImportError:
        raise InputError(f"{file}: reading a LeRobot dataset needs pyarrow; {EXTRA}") from None
    try:
        source = parquet.ParquetFile(file)
        if source.metadata.num_rows > _MOST_ROWS:
            raise InputError(
                f"{file}: {source.metadata.num_rows} rows; at most {_MOST_ROWS} are read"
            )
        present = set(source.schema_arrow.names)
        if STATE not in present:
            raise InputError(f"{file}: no column {STATE}")
        wanted = [c for c in (STATE, "timestamp", "episode_index", "frame_index") if c in present]
        if (count := _values(source.metadata, wanted)) > _MOST_VALUES:
            raise InputError(f"{file}: {count} numbers; at most {_MOST_VALUES} are read")
        columns = source.read(columns=wanted).to_pydict()
        states = columns[STATE]
        count = len(states)
        times = columns.get("timestamp") or [
            k / rate for k in (columns.get("frame_index") or range(count))
        ]
        episodes = columns.get("episode_index") or [0] * count
        return [(int(e), float(t), s) for e, t, s in zip(episodes, times, states, strict=True)]
    except InputError:
        raise
    except Exception as error:  # pyarrow may raise anything.
        text = " ".join(str(error).split())[:120]
        raise InputError(f"{file}: not a parquet file that can be read ({text})") from None


def _values(metadata: Any, columns: list[str]) -> int:
    """Number of values in some columns of a parquet file, from its metadata."""
    groups = [metadata.row_group(k) for k in range(metadata.num_row_groups)]
    chunks = [group.column(k) for group in groups for k in range(group.num_columns)]
    return sum(
        chunk.num_values for chunk in chunks if chunk.path_in_schema.startswith(tuple(columns))
    )


def _tracks(path: Path, name: str, rows: list[tuple[float, Any]], names: list[str]) -> list[Track]:
    try:
        states = np.array([state for _, state in rows], dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{path}: {STATE} of {name} is not a table of numbers") from None
    if states.ndim != 2 or states.shape[1] != len(names):
        raise InputError(
            f"{path}: {STATE} of {name} has shape {states.shape}, but meta/info.json names"
            f" {len(names)} columns"
        )
    values = np.column_stack(([time for time, _ in rows], states))
    if not (np.isfinite(values).all() and np.abs(values).max() < LARGEST_NUMBER):
        raise InputError(f"{path}: {name} holds a value that is not finite")
    tracks = tracks_of_columns(
        path,
        f"{path}, {STATE}",
        ["time [s]", *names],
        lambda columns: (values[:, columns], None, []),
    )
    if not tracks:
        shown = ", ".join(shorten(name) for name in names[:6])
        raise InputError(
            f"{path}: the state's columns ({shown}) are neither x, y, z nor joints of Pepper"
        )
    return [
        replace(
            track,
            name=name if len(tracks) == 1 else f"{name}{track.name.removeprefix(path.stem)}",
            kind="LeRobot dataset",
        )
        for track in tracks
    ]
