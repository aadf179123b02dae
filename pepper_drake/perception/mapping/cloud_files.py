"""Reads point clouds from PCD, PLY, NPZ and NPY files."""

import io
import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.array_files import npz_names, read_npy, read_npz
from pepper_drake.errors import InputError
from pepper_drake.files import read_bytes

_LARGEST = 128 * 2**20
"""Largest cloud file [bytes]."""
_NAMES = ("positions", "points", "xyz", "xyzs", "arr_0")
"""Names of arrays that hold points."""
_KINDS = "fiubUSV"
"""Element types of arrays: numbers, records with fields x, y and z, and strings, to be refused."""
_FARTHEST = 1e6
"""Largest coordinate accepted [m]."""
_FARTHEST_ROOM = 15.0
"""Largest median distance of the points from the cloud's centre that is plausible [m]."""


def load_cloud(path: str | Path, *, scale: float = 1.0) -> npt.NDArray[np.float64]:
    """Reads the points of a cloud.

    Args:
        path: A `.pcd`, `.ply`, `.npz` or `.npy` file. An array is (P, 3); in an NPZ it is named
            positions, points or xyz, or is the only one.
        scale: Unit of the file [m].

    Returns:
        The finite points (P, 3) [m], in the file's frame.

    Raises:
        InputError: If the format is unknown, the file has no points or is apparently not in metres,
            or the library that reads it is not installed.
    """
    path = Path(path)
    readers = {
        ".pcd": lambda path: _pcd(path, io.BytesIO(read_bytes(path, _LARGEST))),
        ".ply": lambda path: _ply(path, io.BytesIO(read_bytes(path, _LARGEST))),
        ".npz": _npz,
        ".npy": lambda path: _array(path, read_npy(path, kinds=_KINDS)),
    }
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: clouds are read from {', '.join(readers)} files.")
    points = reader(path)
    points = points[np.isfinite(points).all(axis=1)] * scale
    if len(points) == 0:
        raise InputError(f"{path}: holds no finite point.")
    if np.abs(points).max() > _FARTHEST:
        raise InputError(
            f"{path}: a point is {np.abs(points).max():.3g} m away; no more than {_FARTHEST:g} m "
            "is read. Write what was not seen as nan."
        )
    spread = float(np.median(np.linalg.norm(points - np.median(points, axis=0), axis=1)))
    if spread > _FARTHEST_ROOM:
        raise InputError(
            f"{path}: half of its points are more than {_FARTHEST_ROOM:g} m from its middle; give "
            "the scale, such as 0.001 for millimetres."
        )
    return points


def _columns(path: Path, table: Any, names: Any) -> npt.NDArray[np.float64]:
    """Returns the columns x, y and z of a structured array (P, 3)."""
    missing = [name for name in "xyz" if name not in (names or ())]
    if missing:
        raise InputError(f"{path}: has no field {missing[0]}.")
    columns = [np.asarray(table[name]) for name in "xyz"]
    if any(column.dtype.kind not in "iuf" for column in columns):
        raise InputError(f"{path}: a field x, y or z holds no numbers.")
    return np.column_stack([column.astype(float).ravel() for column in columns])


def _pcd(path: Path, file: io.BytesIO) -> npt.NDArray[np.float64]:
    try:
        from pypcd4 import PointCloud
    except ImportError:
        raise InputError(
            f'{path}: PCD files are read by pypcd4; install it: pip install "pepper-drake[clouds]".'
        ) from None
    # The headers of versions 0.5 and 0.6 differ from 0.7 only in the missing viewpoint.
    content = re.sub(rb"^VERSION\s+0?\.[56]\b", b"VERSION .7", file.getvalue(), count=1, flags=re.M)
    try:
        cloud = PointCloud.from_fileobj(io.BufferedReader(io.BytesIO(content)))
        table, names = cloud.pc_data, cloud.fields
    except Exception:  # The library's parser raises all kinds of errors.
        raise InputError(f"{path}: is not a PCD file that can be read.") from None
    return _columns(path, table, names)


def _ply(path: Path, file: io.BytesIO) -> npt.NDArray[np.float64]:
    try:
        from plyfile import PlyData
    except ImportError:
        raise InputError(
            f"{path}: PLY files are read by plyfile; install it: "
            'pip install "pepper-drake[clouds]".'
        ) from None
    try:
        vertices = PlyData.read(file)["vertex"].data
    except Exception:  # The library's parser raises all kinds of errors.
        raise InputError(f"{path}: is not a PLY file with vertices that can be read.") from None
    return _columns(path, vertices, vertices.dtype.names)


def _array(path: Path, array: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    if array.dtype.names:
        return _columns(path, array, array.dtype.names)
    if array.dtype.kind not in "iuf" or array.ndim < 2 or array.shape[-1] < 3:
        raise InputError(
            f"{path}: an array of {array.dtype} with shape {array.shape} holds no points; (P, 3) "
            "numbers are read."
        )
    if array.shape[0] == 3 != array.shape[-1]:
        raise InputError(
            f"{path}: an array of shape {array.shape} has x, y, z along its first axis; give its "
            "transpose, (P, 3)."
        )
    return np.asarray(array.reshape(-1, array.shape[-1])[:, :3], dtype=float)


def _npz(path: Path) -> npt.NDArray[np.float64]:
    names = sorted(npz_names(path))
    known = [name for name in _NAMES if name in names] or names
    if len(known) > 1 and known == names:
        raise InputError(
            f"{path}: has {', '.join(names[:5])}; name the points positions, points or xyz."
        )
    arrays = read_npz(path, known[:1], kinds=_KINDS)
    return _array(path, arrays.get(known[0], np.zeros(0)) if known else np.zeros(0))
