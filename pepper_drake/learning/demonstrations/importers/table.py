"""Tables in text files, whatever separates their columns."""

import csv
import math
import stat
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.files import read_text

Array = npt.NDArray[np.float64]

LARGEST = 256 * 2**20
"""A file with more bytes than this is no recording of a movement."""

MOST_ROWS = 2_000_000

LARGEST_NUMBER = 1e20
"""Clocks in nanoseconds reach 2e18; nothing that is recorded exceeds this."""


@dataclass(frozen=True)
class Table:
    """A table of words.

    Attributes:
        path: For messages.
        comments: Lines that begin with # or %, without that sign, with their numbers.
        rows: Of words, stripped.
        lines: The line of each row.
        separator: Between columns: a comma, a semicolon, a tab, or a space for white space.
    """

    path: Path
    comments: tuple[tuple[int, str], ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    separator: str


def check_file(path: Path) -> None:
    """Refuses what cannot be a file of a recording: nothing there, a pipe, gigabytes.

    Raises:
        InputError: With the mend.
    """
    try:
        status = path.stat()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file; check the path") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    if not (stat.S_ISREG(status.st_mode) or stat.S_ISDIR(status.st_mode)):
        raise InputError(f"{path}: not a file (a pipe or a device); give a file")
    if stat.S_ISREG(status.st_mode) and status.st_size > LARGEST:
        raise InputError(
            f"{path}: {status.st_size / 2**20:.0f} MiB; a recording of a movement has at most"
            f" {LARGEST // 2**20}; cut the movement out"
        )


def parse_words(path: Path, text: str | None = None) -> Table:
    """Reads a table of words; the first row that is no comment tells the separator.

    Raises:
        InputError: The file cannot be read, or has too many rows.
    """
    if text is None:
        check_file(path)
        text = read_text(path)
    comments: list[tuple[int, str]] = []
    rows: list[tuple[str, ...]] = []
    lines: list[int] = []
    separator = ""
    for number, line in enumerate(text.split("\n"), start=1):
        content = line.strip().strip("\x00")
        if not content:
            continue
        if content[0] == "#" or (content[0] == "%" and rows == [] and "," not in content):
            comments.append((number, content.lstrip("#% ")))
            continue
        if not separator:
            separator = find_separator(content)
            if separator == " " and "," not in content and not is_number(content.split()[0]):
                # A title: what separates the columns is seen further down.
                separator = find_separator(" ".join(text.split("\n")[number : number + 5]))
        rows.append(split(content, separator))
        lines.append(number)
        if len(rows) > MOST_ROWS:
            raise InputError(f"{path}: more than {MOST_ROWS} rows; cut the movement out")
    return Table(path, tuple(comments), tuple(rows), tuple(lines), separator or " ")


def find_separator(line: str) -> str:
    """Returns what separates the columns of a line."""
    bare = line.split("#")[0]
    for separator in (";", "\t", ","):
        if separator in bare:
            return separator
    return " "


def split(line: str, separator: str) -> tuple[str, ...]:
    """Returns the words of a line; quotes keep separators together."""
    if separator == " ":
        return tuple(line.partition("#")[0].split())
    try:
        words = next(csv.reader([line], delimiter=separator, skipinitialspace=True))
    except (csv.Error, StopIteration):
        words = line.split(separator)
    return tuple(word.strip() for word in words)


def is_number(word: str) -> bool:
    """Tells whether a word is a number, a decimal comma included."""
    try:
        float(word.replace(",", ".", 1))
    except ValueError:
        return False
    return True


def number(word: str, where: str, decimal_comma: bool = False) -> float:
    """Reads one number.

    Args:
        word: The number.
        where: File and line, for the message.
        decimal_comma: The file writes 0,5 for a half.

    Raises:
        InputError: It is none, or not finite, or absurdly large.
    """
    try:
        value = float(word.replace(",", ".", 1) if decimal_comma else word)
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

    Rows in which one of the columns is empty hold nothing, as motion capture writes where it sees
    no marker, and are left out.

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
