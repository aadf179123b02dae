"""Motions of the LASA handwriting set: MATLAB files with a list `demos`."""

import contextlib
import io
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.files import read_bytes
from pepper_drake.learning.demonstrations.importers import mat_process
from pepper_drake.learning.demonstrations.importers.track import Track

Array = npt.NDArray[np.float64]

_COMPRESSED = 15
"""Kind of a compressed variable in a MATLAB file of version 5."""
_LARGEST_UNPACKED = 64 * 2**20
"""Largest total size of such a file's variables, decompressed [bytes]."""
_PATIENCE = 60.0
"""Timeout of the process that reads the file [s]."""


def _unpacked(data: bytes) -> int:
    """Returns the decompressed size of a MATLAB file's variables, up to a little over the limit.

    After a header of 128 bytes, whose last two give the byte order, each variable has a type and a
    size of four bytes each, and that many bytes.
    """
    order, start, total = "<" if data[126:128] == b"IM" else ">", 128, 0
    while start + 8 <= len(data) and total <= _LARGEST_UNPACKED:
        kind, size = struct.unpack_from(f"{order}II", data, start)
        if kind == _COMPRESSED:
            with contextlib.suppress(zlib.error):  # The library reports the damage.
                packed = data[start + 8 : start + 8 + size]
                total += len(zlib.decompressobj().decompress(packed, _LARGEST_UNPACKED + 1))
        start += 8 + size
    return total


def read_lasa(path: Path) -> list[Track]:
    """Reads a motion of the LASA handwriting set: a .mat file with a list `demos` of 2-D paths.

    Khansari-Zadeh and Billard 2011, DOI 10.1109/TRO.2011.2159412. Positions are in mm.

    Raises:
        InputError: It is not such a file.
    """
    data = read_bytes(path)
    if _unpacked(data) > _LARGEST_UNPACKED:
        raise InputError(f"{path}: holds more than {_LARGEST_UNPACKED // 2**20} MiB; cut it")
    found = _demos(path, data)
    tracks = []
    for k, (times, positions) in enumerate(found, start=1):
        if positions.ndim != 2 or positions.shape[1] != len(times) or len(positions) not in (2, 3):
            raise InputError(
                f"{path}: demonstration {k}: pos {positions.shape} and t {times.shape} do not"
                " belong together"
            )
        if not (np.isfinite(times).all() and np.isfinite(positions).all()):
            raise InputError(f"{path}: demonstration {k} holds a value that is not finite")
        tracks.append(
            Track(
                path,
                f"{path.stem}_{k}",
                "LASA handwriting",
                times,
                positions.T,
                time_unit="s",
                unit="mm",
            )
        )
    if not tracks:
        raise InputError(f"{path}: no demonstration in it")
    return tracks


def _demos(path: Path, data: bytes) -> list[tuple[Array, Array]]:
    """Times (N,) [s] and positions (D, N) [mm] of each demonstration, read by another process."""
    command = [sys.executable, "-I", mat_process.__file__]
    try:
        read = subprocess.run(command, input=data, capture_output=True, timeout=_PATIENCE)
    except subprocess.TimeoutExpired:
        raise InputError(f"{path}: no LASA motion (not read within {_PATIENCE:g} s)") from None
    if read.returncode == mat_process.NO_DEMOS:
        raise InputError(
            f"{path}: a .mat file without `demos`, as the LASA set has it; write its motion as a"
            " table (writematrix) with a first line time,x,y,z"
        )
    if read.returncode:
        reason = read.stderr.decode(errors="replace").strip() or "its reader crashed"
        raise InputError(f"{path}: damaged, or no LASA motion ({reason[:160]}); take another copy")
    with np.load(io.BytesIO(read.stdout)) as arrays:
        return [(arrays[f"t{k}"], arrays[f"pos{k}"]) for k in range(len(arrays.files) // 2)]
