"""The folder of a run: its results are there as a whole, or those of the run before."""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Collection, Iterator
from pathlib import Path

from pepper_drake.errors import InputError
from pepper_drake.signals import undisturbed

REPORT = "report.json"
"""The report: it goes first and comes last, so that a folder with one is a whole run's."""

INTERRUPTED = "interrupted"
"""Folder inside a run's folder that keeps what a run has done so far, until it ends."""

_UNFINISHED = ".unfinished"

_LEAST_SPACE = 2**20
"""Space that a disk must have for results [bytes]."""


@contextlib.contextmanager
def whole_results(folder: Path, names: Collection[str]) -> Iterator[Path]:
    """Gives a folder to write results to, which then take the place of those of an earlier run.

    If writing fails, or the program ends before, the earlier results stay as they are. Files of
    other names stay in any case.

    Args:
        folder: Where the results are wanted; made if need be.
        names: Names of all files that such a run may leave; those that this one does not leave
            are removed.

    Raises:
        InputError: The folder cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _clear(folder)
        prefix = f"{_UNFINISHED}-{os.getpid()}-"
        unfinished = Path(tempfile.mkdtemp(dir=folder, prefix=prefix))
    except OSError as error:
        raise InputError(f"{folder}: cannot be written to ({error.strerror})") from None
    try:
        yield unfinished
        with undisturbed():
            _replace(folder, unfinished, names)
    except OSError as error:
        where = error.filename or folder
        raise InputError(f"{where}: cannot be written ({error.strerror})") from None
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def check_writable(folder: Path) -> None:
    """Checks that a folder can be made and a megabyte written to it, without leaving anything.

    Args:
        folder: It need not exist.

    Raises:
        InputError: It cannot.
    """
    existing = folder
    try:
        while not existing.exists() and existing.parent != existing:
            existing = existing.parent
        with tempfile.TemporaryDirectory(dir=existing, prefix=_UNFINISHED) as trial:
            (Path(trial) / "space").write_bytes(bytes(_LEAST_SPACE))
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{folder}: cannot be written to ({reason}); choose another") from None


def _replace(folder: Path, unfinished: Path, names: Collection[str]) -> None:
    """Moves the new results to where the old ones are, the report last."""
    new = {entry.name for entry in unfinished.iterdir()}
    for name in (REPORT, *(set(names) - new)):
        with contextlib.suppress(FileNotFoundError):
            (folder / name).unlink()
    for name in sorted(new, key=lambda name: name == REPORT):
        source, target = unfinished / name, folder / name
        if target.is_dir() and not target.is_symlink():
            shutil.rmtree(target)
        source.replace(target)


def _clear(folder: Path) -> None:
    """Removes what killed programs left."""
    for left in folder.glob(f"{_UNFINISHED}-*-*"):
        number = left.name.split("-")[1]
        if not number.isdecimal() or not _is_running(int(number)):
            shutil.rmtree(left, ignore_errors=True)


def _is_running(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    return True
