"""The folder of a run: either all of its results, or still all of the previous run's."""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Collection, Iterator
from pathlib import Path

from pepper_drake.errors import InputError
from pepper_drake.signals import undisturbed

REPORT = "report.json"
"""The report: removed first and written last, so a folder that has one is complete."""

INTERRUPTED = "interrupted"
"""Subfolder of a run's folder with the intermediate results of a run in progress."""

_UNFINISHED = ".unfinished"

_LEAST_SPACE = 2**20
"""Space that a disk must have for results [bytes]."""


@contextlib.contextmanager
def whole_results(folder: Path, names: Collection[str]) -> Iterator[Path]:
    """Yields a temporary folder whose files replace an earlier run's results at the end.

    If writing fails, or the program ends before, the earlier results stay as they are. Files with
    other names are always kept.

    Args:
        folder: Folder for the results; made if it does not exist.
        names: Names of all files that such a run may write; those that this run does not write
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
    """Checks that a folder can be made and a megabyte written to it; leaves no files behind.

    Args:
        folder: The folder; it need not exist.

    Raises:
        InputError: The folder cannot be written to.
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
    """Replaces the old results by the new ones, the report last."""
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
    """Removes the temporary folders of killed programs."""
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
