"""Reads images and depth images from files."""

import io
import os
import sys
import warnings
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from PIL import Image, TiffImagePlugin
from PIL.TiffImagePlugin import IMAGELENGTH, IMAGEWIDTH

from pepper_drake.array_files import npz_names, read_npy, read_npz
from pepper_drake.errors import InputError
from pepper_drake.files import read_bytes

_LARGEST = 128 * 2**20
"""Largest image file [bytes]."""
_MOST_PIXELS = 2**26
"""Largest number of pixels: the header of a small file may claim billions."""
_FORMATS = ("PNG", "JPEG", "BMP", "PPM", "WEBP", "JPEG2000")


def read_image(path: str | Path) -> npt.NDArray[Any]:
    """Reads an image with all its bits and channels, colours in the order BGR.

    Args:
        path: PNG, JPEG, TIFF, BMP, PNM, WebP or JPEG 2000.

    Returns:
        (height, width[, channels]).

    Raises:
        InputError: The file does not exist, is no image, is damaged, or is too large.
    """
    path = Path(path)
    content = np.frombuffer(read_bytes(path, _LARGEST), np.uint8)
    if _claimed_pixels(content, path) > _MOST_PIXELS:
        raise InputError(f"{path}: more than {_MOST_PIXELS} pixels; give a smaller image.")
    image = _decode(content, cv2.IMREAD_UNCHANGED)
    if image is not None and content[:2].tobytes() == b"\xff\xd8":
        turned = _decode(content, cv2.IMREAD_GRAYSCALE)
        plain = _decode(content, cv2.IMREAD_GRAYSCALE | cv2.IMREAD_IGNORE_ORIENTATION)
        if (
            turned is None
            or plain is None
            or turned.shape != plain.shape
            or np.any(turned != plain)
        ):
            raise InputError(
                f"{path}: is to be shown turned or mirrored, by its EXIF orientation; save it as it"
                " is shown, and give the intrinsics of such images."
            )
    if image is None:
        raise InputError(f"{path}: OpenCV cannot read this image; give a PNG, JPEG or TIFF file.")
    return np.asarray(image)


def write_image(path: Path, image: npt.NDArray[Any]) -> None:
    """Writes an image, colours in the order BGR; unlike OpenCV's writer it raises on failure.

    Args:
        path: The file; its suffix determines the format.
        image: (height, width[, channels]), 8 or 16 bits.

    Raises:
        OSError: It cannot be written.
    """
    path.write_bytes(cv2.imencode(path.suffix, np.ascontiguousarray(image))[1].tobytes())


def _decode(content: npt.NDArray[np.uint8], how: int) -> npt.NDArray[Any] | None:
    """Decodes an image, None on failure.

    Messages of OpenCV's libraries about damaged images are suppressed: the caller reports them.
    """
    sys.stderr.flush()
    terminal, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    try:
        return cv2.imdecode(content, how) if content.size else None
    except cv2.error:
        return None
    finally:
        os.dup2(terminal, 2)
        os.close(terminal)
        os.close(nowhere)


def _claimed_pixels(content: npt.NDArray[np.uint8], path: Path) -> float:
    """Returns the number of pixels according to an image's header."""
    data = content.tobytes()
    stream = io.BytesIO(data)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if data[:4] in (b"II*\0", b"MM\0*"):
                # OpenCV reads more TIFF formats than Pillow: 64-bit floats, three channels of 32.
                tags = TiffImagePlugin.ImageFileDirectory_v2(data[:8])
                stream.seek(tags.next)
                tags.load(stream)
                return int(tags[IMAGEWIDTH]) * int(tags[IMAGELENGTH])
            image = Image.open(stream, formats=_FORMATS)
            return image.width * image.height
    except Image.DecompressionBombError:
        return np.inf
    except Exception:  # A damaged header fails in many ways.
        raise InputError(
            f"{path}: not an image that can be read; give a PNG, JPEG or TIFF file."
        ) from None


def read_depth(path: str | Path) -> npt.NDArray[Any]:
    """Reads a depth image with its stored values; see `depth_in_metres` for their meaning.

    Args:
        path: A 16-bit PNG, a TIFF, or an array in an NPY or NPZ file (the only one, or `depth`).

    Returns:
        (height, width[, 1]).
    """
    path = Path(path)
    if path.suffix.lower() not in (".npy", ".npz"):
        return read_image(path)
    if path.suffix.lower() == ".npy":
        return read_npy(path)
    names = npz_names(path)
    if len(names) > 1 and "depth" not in names:
        raise InputError(f"{path}: has several arrays; name the depth image depth.")
    arrays = read_npz(path, ["depth"] if "depth" in names else None)
    if not arrays:
        raise InputError(f"{path}: has no array.")
    (depth,) = arrays.values()
    return depth
