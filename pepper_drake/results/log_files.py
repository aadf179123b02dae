"""Logs as files of named arrays: what cannot be read is answered with one clear sentence."""

import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError

Array = npt.NDArray[np.float64]


def read_arrays(path: Path, names: Iterable[str]) -> dict[str, Array]:
    """Reads arrays of a log.

    Args:
        path: A file that NumPy's `savez` or `savez_compressed` wrote.
        names: The arrays that are wanted.

    Raises:
        InputError: The file is missing, is no log, or lacks an array.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            return {name: data[name] for name in names}
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such log; run a reach first") from None
    except KeyError as error:
        missing = str(error.args[0]).split()[0]
        raise InputError(f"{path}: the log lacks {missing}; record the run again") from None
    except (ValueError, OSError, EOFError, BadZipFile, zlib.error):
        raise InputError(f"{path}: this is no log of a run; record the run again") from None


def array_names(path: Path) -> frozenset[str]:
    """Returns the names of the arrays that a log has; none if it cannot be read."""
    try:
        with np.load(path, allow_pickle=False) as data:
            return frozenset(data.files)
    except (ValueError, OSError, EOFError, BadZipFile, AttributeError):
        return frozenset()


def check_rows(path: Path, arrays: Mapping[str, Array], shapes: Mapping[str, int | None]) -> None:
    """Checks that arrays have a row for each of the increasing times `time_s`.

    Args:
        path: The log, for errors.
        arrays: By name, `time_s` among them.
        shapes: The number of columns by name; None for an array of one dimension.

    Raises:
        InputError: Naming the array that does not fit.
    """
    times = arrays["time_s"]
    if times.ndim != 1 or len(times) < 2 or not np.all(np.diff(times) > 0.0):
        raise InputError(
            f"{path}: time_s must hold at least two increasing times; record the run again"
        )
    for name, columns in shapes.items():
        wanted = (len(times),) if columns is None else (len(times), columns)
        if arrays[name].shape != wanted:
            raise InputError(
                f"{path}: {name} is {arrays[name].shape} where {wanted} is expected; "
                "record the run again"
            )
