"""Conversion of images of any type to 8 bits, and to grey."""

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError

Image = npt.NDArray[np.uint8]

COLOR_ORDERS = ("rgb", "bgr")
"""Orders of the first three channels; a fourth is transparency."""
_FEWEST_LEVELS = 1024
"""A 16-bit image with all pixels below this uses only the lowest bits."""
_CHANNELS = (1, 3, 4)


def to_8_bit(image: npt.NDArray[Any]) -> Image:
    """Converts an image to 8 bits.

    Args:
        image: (height, width[, channels]) of unsigned 8 or 16 bits, floating-point numbers from 0
            to 1, or booleans.

    Returns:
        The same shape; the image itself if it has 8 bits.

    Raises:
        InputError: If its type, range or shape is not that of an image.
    """
    if image.ndim not in (2, 3) or (image.ndim == 3 and image.shape[2] not in _CHANNELS):
        raise InputError(
            f"image: shape {image.shape} is not (height, width) or (height, width, channels) with "
            "1, 3 or 4 channels."
        )
    if image.dtype == np.uint8:
        return image
    if image.dtype == np.uint16:
        if 0 < image.max(initial=0) < _FEWEST_LEVELS:
            raise InputError(
                f"image: its brightest pixel of 16 bits is {image.max()}; shift the bits that are "
                "used to the top, or give 8 bits."
            )
        return np.asarray((image.astype(np.uint32) + 128) // 257, np.uint8)
    if image.dtype == bool:
        return np.asarray(image * np.uint8(255))
    if image.dtype.kind == "f":
        if image.size and not (np.all(np.isfinite(image)) and 0 <= image.min() <= image.max() <= 1):
            raise InputError(
                f"image: {image.dtype} pixels must be from 0 to 1; convert it to 8 bits first."
            )
        return np.asarray(np.rint(image * 255), np.uint8)
    raise InputError(f"image: pixels of type {image.dtype} are none of an image; give uint8.")


def to_gray(image: npt.NDArray[Any], *, order: str = "rgb") -> Image:
    """Converts an image to 8-bit grey (height, width).

    Args:
        image: (height, width[, channels]): grey, colour or colour with transparency, of any type
            that `to_8_bit` accepts.
        order: "rgb", or "bgr" for images read by OpenCV.
    """
    image = to_8_bit(image)
    if image.ndim == 2:
        return image
    if image.shape[2] == 1:
        return image[..., 0]
    if order not in COLOR_ORDERS:
        raise InputError(f"image: colour order {order!r} must be one of {', '.join(COLOR_ORDERS)}.")
    if image.size == 0:
        return np.zeros(image.shape[:2], np.uint8)
    with_alpha = image.shape[2] == 4
    if order == "rgb":
        code = cv2.COLOR_RGBA2GRAY if with_alpha else cv2.COLOR_RGB2GRAY
    else:
        code = cv2.COLOR_BGRA2GRAY if with_alpha else cv2.COLOR_BGR2GRAY
    return np.asarray(cv2.cvtColor(image, code), np.uint8)
