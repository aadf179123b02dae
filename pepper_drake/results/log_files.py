"""Reading logs, files of named arrays, with one clear sentence for each error."""

from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.array_files import read_npz
from pepper_drake.errors import InputError

Array = npt.NDArray[np.float64]

LONGEST = 3600.0
"""Longest duration of a run that is accepted [s]."""

_LARGEST = 1e6
"""Largest magnitude that is accepted in a log, in SI units."""


def read_arrays(path: Path, names: Iterable[str]) -> dict[str, Array]:
    """Reads arrays of a log.

    Args:
        path: A file that NumPy's `savez` or `savez_compressed` wrote.
        names: Names of the arrays.

    Raises:
        InputError: The file is missing, is not a log, or lacks an array.
    """
    wanted = tuple(names)
    if not path.exists():
        raise InputError(f"{path}: there is no such log; run a reach first")
    try:
        arrays = read_npz(path, wanted)
    except InputError as error:
        why = str(error).removeprefix(f"{path}: ")
        raise InputError(
            f"{path}: this is not a log of a run ({why}); record the run again"
        ) from None
    for name in wanted:
        if name not in arrays:
            raise InputError(f"{path}: the log lacks {name}; record the run again")
        if arrays[name].dtype.kind == "b":
            raise InputError(f"{path}: {name} holds no numbers; record the run again")
    return {name: array.astype(float) for name, array in arrays.items()}


def check_rows(path: Path, arrays: Mapping[str, Array], shapes: Mapping[str, int | None]) -> None:
    """Checks that arrays have a row for each of the increasing times `time_s`.

    Args:
        path: The log, for errors.
        arrays: Arrays by name, including `time_s`.
        shapes: The number of columns by name; None for a one-dimensional array.

    Raises:
        InputError: An array does not fit; the message names it.
    """
    times = arrays["time_s"]
    if times.ndim != 1 or len(times) < 2 or not np.all(np.diff(times) > 0.0):
        raise InputError(
            f"{path}: time_s must hold at least two increasing times; record the run again"
        )
    if not (times[0] >= 0.0 and times[-1] <= LONGEST):
        raise InputError(f"{path}: time_s must be from 0 to {LONGEST:g} s; record the run again")
    for name, columns in shapes.items():
        wanted = (len(times),) if columns is None else (len(times), columns)
        if arrays[name].shape != wanted:
            raise InputError(
                f"{path}: {name} is {arrays[name].shape} where {wanted} is expected; "
                "record the run again"
            )
        if not np.all(np.abs(arrays[name]) <= _LARGEST):
            raise InputError(
                f"{path}: {name} holds numbers that are not finite, or above {_LARGEST:g}; "
                "record the run again"
            )
