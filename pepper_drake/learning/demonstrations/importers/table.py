"""Tables in text files, with any separator."""

import csv
import math
import os
import re
import stat
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.files import read_bytes, refuse_pointer

Array = npt.NDArray[np.float64]

LARGEST = 256 * 2**20
"""Largest size of a file [bytes]; larger ones are no recording of a movement."""

MOST_ROWS = 2_000_000

LARGEST_NUMBER = 1e20
"""Largest number accepted; clocks in nanoseconds reach 2e18."""


@dataclass(frozen=True)
class Table:
    """A table of words.

    Attributes:
        path: For messages.
        comments: Lines that begin with #, // or %, without that sign, with line numbers.
        rows: Of words, stripped.
        lines: The line of each row.
        separator: Between columns: a comma, a semicolon, a tab, a bar, or a space for white space.
        clocks: Columns with dates or times of day, converted to seconds.
    """

    path: Path
    comments: tuple[tuple[int, str], ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    separator: str
    clocks: frozenset[int] = frozenset()


def check_file(path: Path) -> None:
    """Refuses a missing or oversized file, a closed folder, a pipe, a device, a Git LFS pointer.

    Raises:
        InputError: The message says what to do.
    """
    try:
        status = path.stat()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        raise InputError(f"{path}: not a file (a pipe or a device); give a file")
    if stat.S_ISDIR(status.st_mode) and not os.access(path, os.R_OK | os.X_OK):
        raise InputError(f"{path}: cannot be read (Permission denied); change its permissions")
    if stat.S_ISREG(status.st_mode) and status.st_size > LARGEST:
        raise InputError(
            f"{path}: {status.st_size / 2**20:.0f} MiB; a recording of a movement has at most"
            f" {LARGEST // 2**20}; cut the movement out"
        )
    if stat.S_ISREG(status.st_mode):
        try:
            with path.open("rb") as file:
                refuse_pointer(path, file.read(64))
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror})") from None


def read_table_text(path: Path) -> str:
    """Returns the text of a file: UTF-8, UTF-16 with a byte order mark, or Latin-1.

    Raises:
        InputError: The file cannot be read, or is not text.
    """
    content = read_bytes(path)
    try:
        wide = content.startswith((b"\xff\xfe", b"\xfe\xff"))
        text = content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    if any(c < " " and c not in "\t\n\v\f\r\x1a" for c in set(text)):
        raise InputError(
            f"{path}: not a text file; export the motion as a table (CSV) with a first line that"
            " names the columns"
        )
    return text.replace("\r\n", "\n").replace("\r", "\n")


def parse_words(path: Path, text: str | None = None) -> Table:
    """Reads a table of words, with the separator that yields most numbers.

    Raises:
        InputError: The file cannot be read, or has too many rows.
    """
    if text is None:
        check_file(path)
        text = read_table_text(path)
    comments: list[tuple[int, str]] = []
    content: list[tuple[int, str]] = []
    for number, line in enumerate(text.split("\n"), start=1):
        bare = line.strip().strip("\x1a")
        # A header may begin with %, such as rostopic's %time; its line has commas.
        if bare.startswith(("#", "//")) or (bare[:1] == "%" and not content and "," not in bare):
            comments.append((number, bare.lstrip("#%/ ")))
        elif bare.strip(';,\t| "') and not _EXCEL.fullmatch(bare):
            content.append((number, bare))
    if len(content) > MOST_ROWS:
        raise InputError(f"{path}: more than {MOST_ROWS} rows; cut the movement out")
    separator = find_separator([line for _, line in content])
    rows, clocks = _without_clocks([split(line, separator) for _, line in content])
    lines = tuple(number for number, _ in content)
    return Table(path, tuple(comments), rows, lines, separator, clocks)


def find_separator(lines: Sequence[str]) -> str:
    """Returns the separator that yields most numbers in the middle twenty lines."""
    first = max(0, len(lines) // 2 - 10)
    middle = [line.partition("#")[0] for line in lines[first : first + 20]]

    def count(separator: str) -> int:
        # A separating comma is not a decimal comma.
        rows = [split(line, separator) for line in middle]
        words = [word for row in rows if len(row) > 1 for word in row]
        return sum(is_number(word) and not (separator == "," and "," in word) for word in words)

    counts = {separator: count(separator) for separator in (";", "\t", "|", ",", " ")}
    best = max(counts, key=lambda separator: counts[separator])
    if counts[best]:
        return best
    return next((s for s in (";", "\t", "|", ",") if any(s in line for line in middle)), " ")


_EXCEL = re.compile(r'"?sep=.?"?', re.IGNORECASE)
"""A first line that tells Excel the separator."""

_DATE = re.compile(r"\d{4}-\d\d-\d\d[T ]\d\d:\d\d(:\d\d([.,]\d+)?)?(Z|[+-]\d\d:?\d\d)?")
_DAY_AND_TIME = re.compile(r"(\d{4}-\d\d-\d\d) +(?=\d\d:\d\d)")
_SPACE_BEFORE_UNIT = re.compile(r"(?<=\w)[ \t]+(?=[\[(][^\W\d_]{1,12}[\])])")
"""As in `x [mm] y [mm]`: name and unit make one word."""
_CLOCK = re.compile(r"(?:(?:(\d{1,2}):)?(\d{1,2}):)(\d{1,2}(?:[.,]\d+)?)")


def _clock_seconds(word: str) -> float | None:
    """Returns the seconds of a date with a time, or of a time of day; None for other words."""
    if _DATE.fullmatch(word):
        try:
            date = datetime.fromisoformat(word.replace(",", "."))
        except ValueError:
            return None
        return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
    match = _CLOCK.fullmatch(word)
    if match is None or (match[1] is None and not re.search("[.,]", match[3])):
        return None  # 12:30 may be hours and minutes.
    hours, minutes = int(match[1] or 0), int(match[2])
    return 3600.0 * hours + 60.0 * minutes + float(match[3].replace(",", "."))


def _without_clocks(
    rows: list[tuple[str, ...]],
) -> tuple[tuple[tuple[str, ...], ...], frozenset[int]]:
    """Returns rows with dates and times of day as seconds, and their columns."""
    middle = rows[len(rows) // 2] if rows else ()
    clocks = frozenset(i for i, word in enumerate(middle) if _clock_seconds(word) is not None)
    if clocks:
        for k, row in enumerate(rows):
            words = list(row)
            for i in clocks:
                seconds = _clock_seconds(words[i]) if i < len(words) else None
                if seconds is not None:
                    words[i] = f"{seconds:.9f}"
            rows[k] = tuple(words)
    return tuple(rows), clocks


def split(line: str, separator: str) -> tuple[str, ...]:
    """Returns the words of a line; quotes keep separators together."""
    if separator == " ":
        joined = _DAY_AND_TIME.sub(r"\1T", line.partition("#")[0])
        return tuple(_SPACE_BEFORE_UNIT.sub("", joined).split())
    try:
        words = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    except (csv.Error, StopIteration):
        words = line.split(separator)
    return tuple(word.strip() for word in words)


def is_number(word: str) -> bool:
    """Tells whether a word is a number, a decimal comma included."""
    try:
        _float(word.replace(",", ".", 1))
    except ValueError:
        return False
    return True


def _float(word: str) -> float:
    """Reads a number; Fortran's exponent (1.5D-01) is accepted."""
    try:
        return float(word)
    except ValueError:
        if re.fullmatch(r"[+-]?\d*(\.\d*)?[dD][+-]?\d+", word):
            return float(re.sub("[dD]", "e", word))
        raise


def number(word: str, where: str, decimal_comma: bool = False) -> float:
    """Reads one number.

    Args:
        word: The number.
        where: File and line, for the message.
        decimal_comma: The file writes 0,5 for a half.

    Raises:
        InputError: It is not a number, not finite, or above `LARGEST_NUMBER`.
    """
    try:
        value = _float(word.replace(",", ".", 1) if decimal_comma else word)
    except ValueError:
        raise InputError(
            f"{where}: {shorten(word)} is not a number; write one with a decimal point, or remove"
            " the row"
        ) from None
    if not math.isfinite(value):
        raise InputError(
            f"{where}: {shorten(word)} is not a finite number; remove the row or fill in the value"
        )
    if abs(value) > LARGEST_NUMBER:
        raise InputError(f"{where}: {shorten(word)} is larger than anything that is recorded")
    return value


def shorten(word: str) -> str:
    """Returns a word of the file for a message, quoted and printable."""
    clean = "".join(c if c.isprintable() else "?" for c in word)
    return repr(clean if len(clean) <= 40 else clean[:37] + "...")


def numbers(
    table: Table, first: int, columns: Sequence[int], decimal_comma: bool = False
) -> tuple[Array, npt.NDArray[np.int64], list[int]]:
    """Reads columns of the rows from `first` on.

    Rows in which one of the columns is empty are left out: motion capture writes them while a
    marker is not visible.

    Returns:
        The numbers (N, len(columns)), their lines (N,), and the lines that were left out.

    Raises:
        InputError: A row is too short, or a word is not a number.
    """
    widest = max(columns) + 1
    width = len(table.rows[first]) if first < len(table.rows) else widest
    values, lines, empty = [], [], []
    for row, line in zip(table.rows[first:], table.lines[first:], strict=True):
        where = f"{table.path}, line {line}"
        if len(row) < widest:
            raise InputError(
                f"{where}: {len(row)} columns where {widest} or more are expected; complete or"
                " remove the row"
            )
        if len(row) > width and any(row[width:]):
            raise InputError(
                f"{where}: {len(row)} columns where the rows before have {width}; correct or remove"
                " the row"
            )
        words = [row[column] for column in columns]
        if not all(words):
            empty.append(line)
            continue
        values.append([number(word, where, decimal_comma) for word in words])
        lines.append(line)
    shape = (len(values), len(columns))
    return (
        np.array(values, dtype=float).reshape(shape),
        np.array(lines, dtype=np.int64),
        empty,
    )
