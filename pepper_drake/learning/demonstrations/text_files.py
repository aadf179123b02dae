"""Number tables as text: strict reading with errors that name file and line, atomic writing."""

import math
import os
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError

Array = npt.NDArray[np.float64]


def read_text(path: Path) -> str:
    """Returns the file's text.

    Raises:
        InputError: The file is missing, unreadable, or not text.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file; give one with rows of numbers") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def parse_table(
    text: str, path: Path, columns: Sequence[int], meaning: str, separator: str | None = None
) -> Array:
    """Parses rows of numbers; the first column is time and must increase.

    Args:
        text: The rows; `#` starts a comment, empty lines are skipped.
        path: Named in errors.
        columns: The numbers of columns that are allowed; all rows must have the same.
        meaning: What the columns are, for the error about their number.
        separator: Between columns; None means white space.

    Returns:
        (N, number of columns) table with N >= 4.

    Raises:
        InputError: With file, line and how to mend it.
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
            raise InputError(
                f"{path}, line {number}: {len(fields)} columns where {expected} are expected"
                f" ({meaning})"
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


def write_atomically(path: Path, content: str | bytes) -> None:
    """Writes a file so that others see the old one or the new one, never a part.

    Raises:
        InputError: The folder cannot be written to.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content.encode() if isinstance(content, str) else content)
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except OSError as error:
        Path(name).unlink(missing_ok=True)
        raise InputError(f"{path}: cannot be written ({error.strerror})") from None
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
