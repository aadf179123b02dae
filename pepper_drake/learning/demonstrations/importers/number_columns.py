"""Tables of numbers without names: the meaning of the columns is inferred from the values."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from pepper_drake.errors import InputError
from pepper_drake.learning.demonstrations.importers.table import (
    Table,
    is_number,
    numbers,
    shorten,
)
from pepper_drake.learning.demonstrations.importers.track import Track

Array = npt.NDArray[np.float64]

MEANINGS = (
    "time and x y z, then velocities, then accelerations (4, 7 or 10 columns); time, x y z and a"
    " quaternion (8); time, D coordinates, their D velocities and D accelerations (1 + 3 D)"
)

_MATRICES = (12, 13, 16, 17)
"""Columns of a 3 x 4 or 4 x 4 matrix, without and with a time."""

_LAST_ROW = (0.0, 0.0, 0.0, 1.0)
"""Last row of a 4 x 4 matrix of a pose."""

_AGREES = 0.1
"""Largest error of the integral of a derivative, as a share of the column's range."""


def are_derivatives(times: Array, values: Array, rates: Array, share: float = _AGREES) -> bool:
    """Tells whether `rates` (N, D) are the derivatives of `values`, by the trapezoidal rule.

    The integral of the rates must match the values within a share of their range (of their common
    range, as a column at rest may be noisy).
    """
    return derivative_error(times, values, rates) <= share


def derivative_error(times: Array, values: Array, rates: Array) -> float:
    """Returns the largest difference of values (N, D) and integrated rates, relative to range.

    The larger range of the two counts: 0 for derivatives, 1 where one moves and the other does not.
    """
    steps = np.diff(times)[:, None]
    integral = np.concatenate(
        (np.zeros((1, values.shape[1])), np.cumsum(0.5 * (rates[1:] + rates[:-1]) * steps, axis=0))
    )
    moved = values - values[0]
    error = integral - moved
    error = error - error.mean(axis=0)
    size = max(float(np.ptp(moved, axis=0).max()), float(np.ptp(integral, axis=0).max()))
    return float(np.abs(error).max()) / size if size > 0.0 else 0.0


def dimensions(table: Array) -> int | None:
    """Returns D if the columns are time, D values and their first and second derivatives, or None.

    Agreement of both derivatives is no coincidence.
    """
    width = table.shape[1] - 1
    if width % 3 or len(table) < 8:
        return None
    d = width // 3
    times, values = table[:, 0], table[:, 1 : 1 + d]
    rates, curvatures = table[:, 1 + d : 1 + 2 * d], table[:, 1 + 2 * d :]
    if np.ptp(values) == 0.0 or not np.all(np.diff(times) > 0.0):
        return None
    good = are_derivatives(times, values, rates) and are_derivatives(times, rates, curvatures)
    return d if good else None


def read_number_columns(table: Table) -> list[Track]:
    """Reads a table without names.

    Raises:
        InputError: A row is broken, or the columns' meaning cannot be inferred.
    """
    path, width = table.path, len(table.rows[0])
    for column, word in enumerate(table.rows[0], start=1):
        if word and not is_number(word):
            raise InputError(
                f"{path}, line {table.lines[0]}: column {column} holds words ({shorten(word)});"
                " name the columns in a first line"
            )
    if width not in (3, 8, *_MATRICES) and (width < 4 or (width - 1) % 3):
        raise InputError(
            f"{path}, line {table.lines[0]}: {width} columns where 4 or 7 or 10 are expected:"
            f" {MEANINGS}; or name the columns in a first line"
        )
    for row, line in zip(table.rows, table.lines, strict=True):
        if len(row) != width:
            raise InputError(
                f"{path}, line {line}: {len(row)} columns where {width} are expected; complete or"
                " remove the row"
            )
    decimal_comma = table.separator != "," and any("," in w for w in table.rows[0])
    values, lines, _ = numbers(table, 0, range(width), decimal_comma)
    if len(values) < 4:
        raise InputError(f"{path}: {len(values)} rows of numbers; a motion needs at least 4")
    base = Track(
        path,
        path.stem,
        "table of numbers",
        None,
        lines=lines,
        time_unit="s" if 0 in table.clocks else None,
    )
    if width in _MATRICES:
        track = _matrices(base, values)
        if track is not None:
            return [track]
    rising = bool(np.all(np.diff(values[:, 0]) > 0.0))
    d = dimensions(values)
    if d is not None and d != 3:
        return [_trajectory(base, values, d)]
    if not rising and (width == 3 or (width == 7 and _are_quaternions(values[:, 3:]))):
        return [_without_times(base, values)]
    if width in (4, 7, 10):
        return [_trajectory(base, values, 3)]
    if width == 8:
        return [_pose(base, values)]
    if width == 3:
        return [_planar(base, values)]
    raise InputError(
        f"{path}: {width} columns that are not time, {(width - 1) // 3} coordinates and their first"
        " and second derivatives; name the columns in a first line"
    )


def _trajectory(base: Track, values: Array, d: int) -> Track:
    width = values.shape[1]
    parts: Sequence[Array | None] = [
        values[:, 1 + k * d : 1 + (k + 1) * d] if width > k * d + 1 else None for k in range(3)
    ]
    kind = f"trajectory of {d} dimensions: time, values, rates, curvatures" if d != 3 else base.kind
    return replace(base, kind=kind, times=values[:, 0], positions=parts[0], velocities=parts[1],
                 accelerations=parts[2])  # fmt: skip


def _matrices(base: Track, values: Array) -> Track | None:
    """Returns poses from a 3 x 4 or 4 x 4 matrix in each row (KITTI), or None if they are no poses.

    A 4 x 4 matrix may be written row by row or column by column: its last row tells.
    """
    timed = values.shape[1] % 2
    matrices = values[:, timed:].reshape(len(values), -1, 4)
    if matrices.shape[1] == 4:
        if np.abs(matrices[:, :, 3] - _LAST_ROW).max() < 1e-6:  # Column by column: Franka's O_T_EE.
            matrices = matrices.swapaxes(1, 2)
        if np.abs(matrices[:, 3] - _LAST_ROW).max() > 1e-6:
            return None
    turns = matrices[:, :3, :3]
    square = np.abs(turns @ turns.swapaxes(1, 2) - np.eye(3)).max()
    if square > 1e-2 or np.linalg.det(turns).min() < 0.9:
        return None
    xyzw = Rotation.from_matrix(turns).as_quat()
    return replace(base, kind="rows of matrices, as KITTI has them",
                   times=values[:, 0] if timed else None, positions=matrices[:, :3, 3],
                   rotations=xyzw, quaternion="xyzw")  # fmt: skip


def _pose(base: Track, values: Array) -> Track:
    norms = np.linalg.norm(values[:, 4:], axis=1)
    wrong = np.flatnonzero(np.abs(norms - 1.0) > 1e-2)
    if len(wrong):
        raise InputError(
            f"{base.where(int(wrong[0]))}: 8 columns, but the last four have norm"
            f" {norms[wrong[0]]:.4g} and are no unit quaternion; name the columns in a first line"
        )
    named = base.path.suffix.lower() == ".tum"
    return replace(base, kind="TUM" if named else "poses: time, position, quaternion",
                 times=values[:, 0], positions=values[:, 1:4], rotations=values[:, 4:],
                 quaternion="xyzw" if named else None)  # fmt: skip


def _without_times(base: Track, values: Array) -> Track:
    rotations = None
    if values.shape[1] == 7:
        rotations = values[:, 3:]
    return replace(base, kind="positions without times", positions=values[:, :3],
                 rotations=rotations)  # fmt: skip


def _planar(base: Track, values: Array) -> Track:
    return replace(base, kind="path of 2 dimensions: time, x, y", times=values[:, 0],
                 positions=values[:, 1:])  # fmt: skip


def _are_quaternions(values: Array) -> bool:
    return bool(np.all(np.abs(np.linalg.norm(values, axis=1) - 1.0) < 1e-2))
