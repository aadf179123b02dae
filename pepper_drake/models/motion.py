"""Motions of obstacles and the goal object: a smooth path through rows of time and offset."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from pydrake.trajectories import PiecewisePolynomial

from pepper_drake.errors import InputError
from pepper_drake.files import read_text

LONGEST = 600.0
"""Longest duration of a path or script [s]."""

FARTHEST = 100.0
"""Largest coordinate of positions and offsets [m]."""

_MOST_TURN = 6.3
"""Largest angle of a pose or joint [rad]: a full turn. More would be degrees."""
_SHORTEST = 1e-3
_MOST_ROWS = 5_000
_FILE_LIMIT = 2**20

MOTION_DIRECTIONS: dict[str, tuple[float, float, float]] = {
    "up": (0.0, 0.0, 1.0),
    "aside": (0.0, 1.0, 0.0),
    "away": (1.0, 0.0, 0.0),
}
"""Directions of `goal_motion` for a robot that faces +x; "aside" is for the left arm."""


def check_angles(angles: Iterable[float], field: str) -> None:
    """Raises InputError, naming `field`, if one of its angles [rad] is more than a full turn."""
    for angle in angles:
        if not abs(angle) <= _MOST_TURN:
            raise InputError(
                f"{field} has an angle of {angle:g}, more than a full turn; angles are in radians"
            )


def check_path(path: Sequence[Sequence[float]], field: str) -> None:
    """Raises InputError, naming `field`, unless rows are (time, x, y, z) with increasing times."""
    if len(path) == 1:
        raise InputError(f"{field} has one row; a path has at least two")
    for index, row in enumerate(path):
        if len(row) != 4:
            raise InputError(f"{field}[{index}] has {len(row)} numbers; it must be time, x, y, z")
        if not np.all(np.isfinite(row)):
            raise InputError(f"{field}[{index}] must hold finite numbers")
        if index > 0 and row[0] <= path[index - 1][0]:
            raise InputError(f"{field}[{index}] must be later than the row before it")
    if path and path[0][0] < 0.0:
        raise InputError(f"{field}[0] must not begin before time 0")
    _check_range(path, field)


def _check_range(path: Sequence[Sequence[float]], name: str) -> None:
    if len(path) > _MOST_ROWS:
        raise InputError(f"{name} has {len(path)} rows; give at most {_MOST_ROWS}")
    if path and path[-1][0] > LONGEST:
        raise InputError(f"{name} ends at {path[-1][0]:g} s; it must end by {LONGEST:g} s")
    for one, other in pairwise(path):
        if other[0] - one[0] < _SHORTEST:
            raise InputError(f"{name} has rows less than {_SHORTEST:g} s apart, at {one[0]:g} s")
    if path and np.abs(np.array(path)[:, 1:]).max() > FARTHEST:
        raise InputError(f"{name} leads farther than {FARTHEST:g} m away")


def path_trajectory(path: Sequence[Sequence[float]]) -> PiecewisePolynomial:
    """Returns the smooth offset [m] over time [s] through rows of (time, x, y, z).

    Piecewise cubic, without overshoot (Fritsch and Carlson 1980), at rest at both ends; outside
    the rows' times it holds the first or last offset.
    """
    rows = np.asarray(path, dtype=float)
    return PiecewisePolynomial.CubicShapePreserving(
        breaks=rows[:, 0], samples=rows[:, 1:].T, zero_end_point_derivatives=True
    )


def goal_motion(
    direction: str,
    arm: str,
    *,
    distance: float = 0.08,
    start: float = 0.0,
    duration: float = 1.5,
) -> list[list[float]]:
    """Returns the path of a goal object that makes one straight motion.

    Args:
        direction: "up", "aside" (to the side of the reaching arm, where it can follow) or "away"
            (from the robot), as seen by a robot that faces the world's +x.
        arm: "left" or "right".
        distance: Length of the motion [m].
        start: Start time [s].
        duration: Duration [s].

    Returns:
        Rows of (time, x, y, z), offsets from the object's initial position in the world frame.

    Raises:
        InputError: If the direction is unknown or a number makes no sense.
    """
    if direction not in MOTION_DIRECTIONS:
        raise InputError(
            f'goal motion is "{direction}"; it must be one of {", ".join(MOTION_DIRECTIONS)} '
            "or a path file"
        )
    if not (np.isfinite(distance) and np.isfinite(start) and start >= 0.0 and duration > 0.0):
        raise InputError(
            "goal motion needs a finite distance, a start of at least 0 s and a positive duration"
        )
    x, y, z = MOTION_DIRECTIONS[direction]
    side = 1.0 if arm == "left" else -1.0
    offset = [x * distance, side * y * distance, z * distance]
    return [[start, 0.0, 0.0, 0.0], [start + duration, *offset]]


def load_path(file: Path) -> list[list[float]]:
    """Loads a path from a text file: rows of time x y z, `#` starts a comment.

    Raises:
        InputError: If the file is missing or a row is wrong; the message names file and line.
    """
    lines = read_text(file, _FILE_LIMIT).splitlines()
    rows: list[list[float]] = []
    for number, line in enumerate(lines, start=1):
        words = line.split("#", 1)[0].replace(",", " ").split()
        if not words:
            continue
        where = f"{file} line {number}"
        if len(words) != 4:
            raise InputError(f"{where} has {len(words)} columns; it must be time x y z")
        try:
            row = [float(word) for word in words]
        except ValueError:
            raise InputError(f"{where} must hold four numbers: time x y z") from None
        if not np.all(np.isfinite(row)):
            raise InputError(f"{where} must hold finite numbers")
        if row[0] < 0.0 or (rows and row[0] <= rows[-1][0]):
            raise InputError(f"{where}: time must not be negative and must increase")
        rows.append(row)
    if len(rows) < 2:
        raise InputError(f"{file} has {len(rows)} rows of numbers; a path has at least two")
    _check_range(rows, str(file))
    return rows
