"""Reads images and depth images from files."""

import io
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.files import read_bytes

_LARGEST = 256 * 2**20
"""Largest image file [bytes]."""


def read_image(path: str | Path) -> npt.NDArray[Any]:
    """Reads an image as OpenCV does, with all its bits and channels, colours in the order BGR.

    Args:
        path: PNG, JPEG, TIFF, or whatever else OpenCV reads.

    Returns:
        (height, width[, channels]).
    """
    path = Path(path)
    content = np.frombuffer(read_bytes(path, _LARGEST), np.uint8)
    try:
        image = cv2.imdecode(content, cv2.IMREAD_UNCHANGED) if content.size else None
    except cv2.error:
        image = None
    if image is not None and content[:2].tobytes() == b"\xff\xd8":
        turned = cv2.imdecode(content, cv2.IMREAD_GRAYSCALE)
        plain = cv2.imdecode(content, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
        if turned.shape != plain.shape or np.any(turned != plain):
            raise InputError(
                f"{path}: is to be shown turned or mirrored, by its EXIF orientation; save it as it"
                " is shown, and give the intrinsics of such images."
            )
    if image is None:
        raise InputError(f"{path}: OpenCV cannot read this image; give a PNG, JPEG or TIFF file.")
    return np.asarray(image)


def read_depth(path: str | Path) -> npt.NDArray[Any]:
    """Reads a depth image as it is stored; `depth_in_metres` says what its values mean.

    Args:
        path: A 16-bit PNG, a TIFF, or an array in an NPY or NPZ file (the only one, or `depth`).

    Returns:
        (height, width[, 1]).
    """
    path = Path(path)
    if path.suffix.lower() not in (".npy", ".npz"):
        return read_image(path)
    try:
        loaded = np.load(io.BytesIO(read_bytes(path, _LARGEST)), allow_pickle=False)
        if isinstance(loaded, np.ndarray):
            return loaded
        name = "depth" if "depth" in loaded.files else loaded.files[0]
        if name != "depth" and len(loaded.files) > 1:
            raise InputError(f"{path}: has several arrays; name the depth image depth.")
        return np.asarray(loaded[name])
    except InputError:
        raise
    except Exception:  # A damaged file fails in many ways.
        raise InputError(
            f"{path}: is not a NumPy file of a depth image that can be read."
        ) from None
