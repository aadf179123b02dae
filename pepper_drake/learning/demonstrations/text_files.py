"""Number tables as text: strict parsing with errors that name file and line."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError

Array = npt.NDArray[np.float64]


def parse_table(
    text: str, path: Path, columns: Sequence[int], meaning: str, separator: str | None = None
) -> Array:
    """Parses rows of numbers; the first column is time and must increase.

    Args:
        text: The rows; `#` starts a comment, empty lines are skipped.
        path: Named in errors.
        columns: Allowed numbers of columns; all rows must have the same.
        meaning: What the columns are, for the error about their number.
        separator: Between columns; None means white space.

    Returns:
        (N, number of columns) table with N >= 4.

    Raises:
        InputError: With file, line and what to do.
    """
    rows: list[list[float]] = []
    width = 0
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.partition("#")[0].strip()
        if not content:
            continue
        fields = content.split(separator)
        if len(fields) != (width or len(fields)) or len(fields) not in columns:
            expected = str(width) if width else " or ".join(str(c) for c in columns)
            mend = ""
            if separator is None and (other := next((s for s in ",;|" if s in content), None)):
                mend = f"; separate them by spaces, not by {other!r}, with decimal points"
            raise InputError(
                f"{path}, line {number}: {len(fields)} columns where {expected} are expected"
                f" ({meaning}){mend}"
            )
        width = len(fields)
        rows.append([_number(field, path, number) for field in fields])
        if len(rows) > 1 and rows[-1][0] <= rows[-2][0]:
            raise InputError(
                f"{path}, line {number}: time {rows[-1][0]:g} does not come after"
                f" {rows[-2][0]:g}; rows must be in order of time, each time once"
            )
    if len(rows) < 4:
        raise InputError(f"{path}: {len(rows)} rows of numbers; a motion needs at least 4")
    return np.array(rows)


def row_lines(text: str) -> npt.NDArray[np.int64]:
    """Returns the line numbers of the rows that `parse_table` reads."""
    lines = enumerate(text.splitlines(), start=1)
    return np.array([n for n, line in lines if line.partition("#")[0].strip()], dtype=np.int64)


def _number(field: str, path: Path, line: int) -> float:
    try:
        value = float(field)
    except ValueError:
        raise InputError(
            f"{path}, line {line}: '{field.strip()}' is not a number; write one with a decimal"
            " point, and start comments with #"
        ) from None
    if not math.isfinite(value):
        raise InputError(
            f"{path}, line {line}: {field.strip()} is not a finite number; remove the row or"
            " fill in the value"
        )
    return value


def format_table(table: npt.ArrayLike, separator: str = " ") -> str:
    """Returns one line per row, each number in the shortest form that reads back the same."""
    lines = (separator.join(map(repr, row)) for row in np.asarray(table, dtype=float).tolist())
    return "\n".join(lines) + "\n"
