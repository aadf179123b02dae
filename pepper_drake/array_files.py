"""Arrays in numpy's npz and npy files of unknown origin, read within limits."""

import io
import math
import tokenize
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.files import read_bytes

FILE_LIMIT = 64 * 2**20
"""Largest size of an npz file [bytes]."""

_ARRAYS_LIMIT = 128 * 2**20
"""Largest total size of a file's arrays [bytes]."""

_MOST_ARRAYS = 100_000
_HEADER_LIMIT = 4096
_BROKEN = (
    zipfile.BadZipFile,
    zlib.error,
    EOFError,
    ValueError,
    KeyError,
    TypeError,
    OverflowError,
    RuntimeError,  # Encrypted, or a compression that numpy does not write.
    SyntaxError,
    tokenize.TokenError,
    RecursionError,
    MemoryError,
)


def read_npz(
    path: Path, names: Iterable[str] | None = None, *, kinds: str = "fiub"
) -> dict[str, npt.NDArray[Any]]:
    """Reads arrays of an npz file.

    Args:
        path: A file that numpy's `savez` or `savez_compressed` wrote.
        names: The wanted arrays, if present; all if None.
        kinds: Accepted kinds of elements, as in `dtype.kind`.

    Returns:
        The arrays by name.

    Raises:
        InputError: There is no such file, it is not an npz file, is damaged or too large, or an
            array has elements of another kind.
    """
    content = read_bytes(path, FILE_LIMIT)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = _members(archive)
            wanted = members if names is None else [name for name in names if name in members]
            if sum(members[name].file_size for name in wanted) > _ARRAYS_LIMIT:
                raise InputError(f"{path}: holds more than {_ARRAYS_LIMIT / 2**20:.0f} MiB")
            return {name: _read_array(archive, members[name], kinds) for name in wanted}
    except _BROKEN:
        raise InputError(f"{path}: not an npz file of numbers, or damaged") from None


def read_npy(path: Path, *, kinds: str = "fiub") -> npt.NDArray[Any]:
    """Reads the array of an npy file.

    Args:
        path: A file that numpy's `save` wrote.
        kinds: Accepted kinds of elements, as in `dtype.kind`.

    Raises:
        InputError: There is no such file, it is not an npy file, is damaged or too large, or its
            elements are of another kind.
    """
    content = read_bytes(path, _ARRAYS_LIMIT)
    try:
        return _parse_array(content, kinds)
    except _BROKEN:
        raise InputError(f"{path}: not an NPY file of numbers, or damaged") from None


def npz_names(path: Path) -> frozenset[str]:
    """Returns the names of the arrays in an npz file.

    Raises:
        InputError: There is no such file, or it is not an npz file.
    """
    content = read_bytes(path, FILE_LIMIT)
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            return frozenset(_members(archive))
    except _BROKEN:
        raise InputError(f"{path}: not an npz file of numbers, or damaged") from None


def _members(archive: zipfile.ZipFile) -> dict[str, zipfile.ZipInfo]:
    entries = archive.infolist()
    if len(entries) > _MOST_ARRAYS:
        raise ValueError("too many arrays")
    members = {entry.filename.removesuffix(".npy"): entry for entry in entries}
    if len(members) < len(entries):
        raise ValueError("a name twice")
    return members


def _read_array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, kinds: str) -> npt.NDArray[Any]:
    with archive.open(entry) as file:
        # One byte more than declared: reading to the end compares the checksum.
        return _parse_array(file.read(entry.file_size + 1), kinds)


def _parse_array(content: bytes, kinds: str) -> npt.NDArray[Any]:
    stream = io.BytesIO(content)
    version = np.lib.format.read_magic(stream)
    read = {
        (1, 0): np.lib.format.read_array_header_1_0,
        (2, 0): np.lib.format.read_array_header_2_0,
    }[version]
    shape, in_columns, dtype = read(stream, max_header_size=_HEADER_LIMIT)
    if dtype.kind not in kinds or dtype.hasobject or dtype.itemsize == 0:
        raise ValueError("elements of another kind")
    if any(type(size) is not int or size < 0 for size in shape) or len(shape) > 8:
        raise ValueError("no shape")
    if math.prod(shape) * dtype.itemsize != len(content) - stream.tell():
        raise ValueError("not as many elements as the shape says")
    array = np.frombuffer(content, dtype, offset=stream.tell())
    return array.reshape(shape, order="F" if in_columns else "C").copy()
