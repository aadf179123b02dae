"""Checks meshes in Wavefront OBJ files before they are used."""

import math
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.files import path_inside, read_bytes, read_text

OBJ_LIMIT = 16 * 2**20
"""Largest OBJ file that is read [bytes]."""

_MATERIAL_LIMIT, _TEXTURE_LIMIT = 2**20, 16 * 2**20
_MOST_VERTICES = 200_000
_LARGEST = 1e4
"""Largest coordinate, in the file's unit."""
_THINNEST = 1e-4
"""Volume of a hull, relative to a cube of its extent, below which it is flat."""
_IGNORED = ("o", "g", "s", "usemtl")
_TEXTURES = {".png": b"\x89PNG\r\n\x1a\n", ".jpg": b"\xff\xd8\xff", ".jpeg": b"\xff\xd8\xff"}

Array = npt.NDArray[np.float64]


def check_obj(path: Path) -> None:
    """Checks a mesh and its material and texture files.

    Args:
        path: The OBJ file.

    Raises:
        InputError: With file and line: a statement cannot be read, a face has an undefined corner,
            the mesh has no volume, or it refers to a file outside its folder.
    """
    try:
        status = path.stat()
    except (OSError, ValueError):
        raise InputError(f"{path}: no such file; check the path") from None
    _check(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=64)
def _check(path: Path, changed: int, size: int) -> None:
    del changed, size  # Only part of the cache key: they change with the file.
    vertices: list[tuple[float, ...]] = []
    counts = {"v": 0, "vt": 0, "vn": 0}
    faces = 0
    for number, line in enumerate(read_text(path, OBJ_LIMIT).split("\n"), start=1):
        content = line.partition("#")[0]
        words = content.split()
        if not words:
            continue
        where = f"{path} line {number}"
        if not content.rstrip("\r").replace("\t", " ").isprintable():
            # Python takes some of these for spaces; other readers of the mesh do not.
            raise InputError(f"{where}: has control characters or spaces of another kind")
        kind, values = words[0], words[1:]
        if kind in counts:
            vector = _vector(kind, values, where)
            counts[kind] += 1
            if counts[kind] > _MOST_VERTICES:
                raise InputError(f"{where}: more than {_MOST_VERTICES} {kind}; use a coarser mesh")
            if kind == "v":
                vertices.append(vector[:3])
        elif kind == "f":
            faces += 1
            _check_face(values, counts, where)
        elif kind == "mtllib":
            for name in values:
                _check_materials(path, name, where)
        elif kind not in _IGNORED:
            raise InputError(
                f"{where}: {kind[:20]} is not read; a mesh has v, vt, vn, f, and materials"
            )
    if faces < 4 or len(vertices) < 4:
        raise InputError(f"{path}: {faces} faces and {len(vertices)} vertices enclose no solid")
    _check_volume(np.array(vertices), path)


def _vector(kind: str, values: list[str], where: str) -> tuple[float, ...]:
    expected = {"v": (3, 4, 6), "vt": (1, 2, 3), "vn": (3,)}[kind]
    try:
        vector = tuple(float(value) for value in values)
    except ValueError:
        vector = ()
    good = len(vector) in expected and all(abs(value) <= _LARGEST for value in vector)
    if not good or any("_" in value for value in values):
        raise InputError(f"{where}: {kind} needs {expected[0]} numbers of at most {_LARGEST:g}")
    return vector


def _check_face(corners: list[str], counts: dict[str, int], where: str) -> None:
    if not 3 <= len(corners) <= 64:
        raise InputError(f"{where}: a face has 3 to 64 corners, not {len(corners)}")
    seen = set()
    forms = set()
    for corner in corners:
        parts = corner.split("/")
        if len(parts) > 3:
            raise InputError(
                f"{where}: {corner[:40]} is not a corner; write v, v/vt, v//vn or v/vt/vn"
            )
        forms.add(tuple(bool(part) for part in parts))
        for part, kind in zip(parts, ("v", "vt", "vn"), strict=False):
            if not part and kind == "vt" and len(parts) == 3:
                continue
            index = _index(part)
            if (
                index is None
                or not 1 <= (index if index > 0 else counts[kind] + 1 + index) <= (counts[kind])
            ):
                raise InputError(
                    f"{where}: there is no {kind} number {part[:20]}; there are {counts[kind]}"
                )
            if kind == "v":
                seen.add(index if index > 0 else counts[kind] + 1 + index)
    if len(seen) < len(corners) or len(forms) > 1:
        raise InputError(f"{where}: the corners of a face must differ, and be written alike")


def _index(text: str) -> int | None:
    digits = text.removeprefix("-")
    if not digits.isascii() or not digits.isdecimal() or len(digits) > 9:
        return None
    return int(text) or None


def _check_materials(mesh: Path, name: str, where: str) -> None:
    """Checks that materials and their textures are inside the mesh's folder."""
    try:
        path = path_inside(mesh.parent, name)
        if path.suffix != ".mtl":
            raise InputError(f"{name[:80]} is not an .mtl file")
        for line in read_text(path, _MATERIAL_LIMIT).splitlines():
            words = line.partition("#")[0].split()
            if words and (words[0].startswith(("map_", "bump", "disp", "decal", "refl", "norm"))):
                _check_texture(mesh, words[-1] if len(words) > 1 else "")
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _check_texture(mesh: Path, name: str) -> None:
    path = path_inside(mesh.parent, name)
    magic = _TEXTURES.get(path.suffix.lower())
    if magic is None or not read_bytes(path, _TEXTURE_LIMIT).startswith(magic):
        raise InputError(f"{name[:80]} is not a picture; use .png or .jpg")


def _check_volume(vertices: Array, path: Path) -> None:
    extent = float(np.ptp(vertices, axis=0).max())
    volume = 0.0
    if extent > 0.0:
        # Imported here, as playback loads no meshes and need not wait for scipy.
        from scipy.spatial import ConvexHull, QhullError

        try:
            volume = ConvexHull((vertices - vertices.mean(axis=0)) / extent).volume
        except (QhullError, ValueError):
            volume = 0.0
    if not math.isfinite(volume) or volume < _THINNEST:
        raise InputError(f"{path}: the mesh is flat; its convex hull must have a volume")
