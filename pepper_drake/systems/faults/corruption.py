"""Corrupts vectors, poses, images and point clouds."""

from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud
from pydrake.systems.sensors import ImageDepth16U, ImageRgba8U

from pepper_drake.systems.faults.fault import Signal

Vector = npt.NDArray[np.float64]

_FAR_OUTSIDE = 1e3
"""Standard deviation of garbage numbers."""


def corrupt(
    value: Any,
    kind: str,
    signal: Signal,
    draw: np.random.Generator,
    shape: np.random.Generator,
    elements: list[int] | None = None,
) -> Any:
    """Corrupts a value with garbage, an offset or noise.

    Args:
        value: A vector (n,), a RigidTransform, a depth or colour image, or a PointCloud.
        kind: "garbage", "wrong" or "noisy".
        signal: Sizes of offset and noise.
        draw: Random numbers that differ for each value.
        shape: Random numbers that are the same for the whole fault: in the same state at each call.
        elements: Indices of the corrupted elements of a vector; all if omitted.

    Returns:
        A new value of the same type.
    """
    if isinstance(value, RigidTransform):
        return _corrupt_pose(value, kind, signal, draw, shape)
    if isinstance(value, PointCloud):
        return _corrupt_cloud(value, kind, signal, draw, shape)
    if isinstance(value, ImageDepth16U | ImageRgba8U):
        return _corrupt_image(value, kind, signal, draw, shape)
    return _corrupt_vector(np.asarray(value, dtype=float), kind, signal, draw, shape, elements)


def _corrupt_vector(
    value: Vector,
    kind: str,
    signal: Signal,
    draw: np.random.Generator,
    shape: np.random.Generator,
    elements: list[int] | None,
) -> Vector:
    chosen = list(range(len(value))) if elements is None else elements
    result = value.copy()
    if kind == "garbage":
        is_missing = shape.random() < 0.5
        result[chosen] = np.nan if is_missing else _FAR_OUTSIDE * draw.normal(size=len(chosen))
    elif kind == "wrong":
        result[chosen] += signal.offset * shape.choice([-1.0, 1.0], size=len(chosen))
    else:
        result[chosen] += signal.noise * draw.normal(size=len(chosen))
    return result


def _corrupt_pose(
    value: RigidTransform,
    kind: str,
    signal: Signal,
    draw: np.random.Generator,
    shape: np.random.Generator,
) -> RigidTransform:
    if kind == "garbage":
        far = _FAR_OUTSIDE * draw.normal(size=3)
        position = np.full(3, np.nan) if shape.random() < 0.5 else far
        return RigidTransform(value.rotation(), position)
    if kind == "wrong":
        direction = shape.normal(size=3)
        offset = signal.offset * direction / np.linalg.norm(direction)
        return RigidTransform(value.rotation(), value.translation() + offset)
    return RigidTransform(
        value.rotation(), value.translation() + signal.noise * draw.normal(size=3)
    )


def _corrupt_cloud(
    value: PointCloud,
    kind: str,
    signal: Signal,
    draw: np.random.Generator,
    shape: np.random.Generator,
) -> PointCloud:
    result = PointCloud(value)
    points = result.mutable_xyzs()
    if kind == "garbage":
        is_missing = shape.random() < 0.5
        points[:] = np.nan if is_missing else _FAR_OUTSIDE * draw.normal(size=points.shape)
    elif kind == "wrong":
        direction = shape.normal(size=3)
        points[:] += (signal.offset * direction / np.linalg.norm(direction))[:, None]
    else:
        points[:] += signal.noise * draw.normal(size=points.shape)
    return result


def _corrupt_image(
    value: Any,
    kind: str,
    signal: Signal,
    draw: np.random.Generator,
    shape: np.random.Generator,
) -> Any:
    pixels = np.array(value.data)
    if pixels.size == 0:
        return type(value)()  # No image yet.
    largest = np.iinfo(pixels.dtype).max
    if kind == "garbage":
        which = shape.integers(3)
        pixels = (
            np.zeros_like(pixels),
            np.full_like(pixels, largest),
            draw.integers(0, largest, pixels.shape, pixels.dtype, endpoint=True),
        )[which]
    elif kind == "wrong":
        if shape.random() < 0.5:  # The wrong resolution.
            pixels = pixels[::2, ::2]
        elif isinstance(value, ImageDepth16U):  # The wrong depth scale.
            scale = 1.0 + shape.choice([-2.0, 2.0]) * signal.offset
            pixels = np.minimum(pixels * scale, largest).astype(pixels.dtype)
        else:  # A shifted lens.
            pixels = np.roll(pixels, round(signal.offset * pixels.shape[1]), axis=1)
    else:
        broken = draw.random(pixels.shape[:2]) < signal.noise
        pixels[broken] = draw.choice([0, largest], size=(broken.sum(), 1))
    return _image(type(value), pixels)


def _image(image_type: Any, pixels: npt.NDArray[Any]) -> Any:
    """Makes an image of pixels (height, width, channels)."""
    image = image_type(pixels.shape[1], pixels.shape[0])
    image.mutable_data[:] = pixels
    return image
