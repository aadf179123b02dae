"""Sensor noise of rendered images: colour noise, depth noise, quantisation, dropouts.

The functions are deterministic: the same seed and frame number give the same image. Normal deviates
come from a field that is drawn once per seed and read at an offset chosen by the frame number,
since drawing a million of them for each frame would cost more than rendering.
"""

import functools
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.perception.cameras.camera import CameraIntrinsics, distortion_maps
from pepper_drake.perception.cameras.structured_light import (
    dark_patches,
    grazing_pixels,
    projector_shadow,
    quantisation_sigma,
    quantise_depth,
)

_SHIFTS = 96
"""Number of offsets along each axis at which the field of deviates is read."""


@dataclass(unsafe_hash=True)
class ColorNoise:
    """Noise of a small colour camera.

    Attributes:
        sigma: Standard deviation of every channel of every pixel [grey levels].
    """

    sigma: float = 3.0


@dataclass(unsafe_hash=True)
class DepthNoise:
    """Noise of a structured-light depth camera.

    The standard deviation is `floor + growth * (z - 0.4)^2` (Nguyen, Izadi and Lovell 2012,
    "Modeling Kinect Sensor Noise for Improved 3D Reconstruction and Tracking", eq. 5).

    Attributes:
        floor: Standard deviation at 0.4 m [m].
        growth: Growth with the square of the distance [1/m].
        edge_jump: Smallest step between neighbouring pixels that counts as an edge, as a fraction
            of the depth.
        edge_loss: Fraction of edge pixels that drop out.
        edge_mix: Fraction of edge pixels that measure a depth between the two surfaces.
        loss: Fraction of all pixels that drop out.
        baseline: Position of the infrared projector along the camera's x axis [m]: pixels in its
            shadow drop out. 0 for a camera without a projector, which is not quantised either.
        disparity_step: Resolution of the pattern's disparity [pixels]; an eighth of a pixel of a
            sensor with twice the resolution.
        grazing: Cosine of the angle of incidence below which pixels begin to drop out; at half of
            it all do.
        dark_fraction: Fraction of the surfaces that is too dark or too shiny to be measured, in
            patches fixed in the world.
        border: Width of the blank band at the image's right border [pixels].
    """

    floor: float = 0.0012
    growth: float = 0.0019
    edge_jump: float = 0.04
    edge_loss: float = 0.5
    edge_mix: float = 0.15
    loss: float = 0.002
    baseline: float = 0.075
    disparity_step: float = 1.0 / 16.0
    grazing: float = 0.2
    dark_fraction: float = 0.01
    border: int = 4

    def sigma(self, depth: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
        """Returns the standard deviation of a depth measurement [m].

        Args:
            depth: Depths [m], any shape.
        """
        return self.floor + self.growth * np.square(depth - 0.4)


NO_DEPTH_NOISE = DepthNoise(
    floor=0.0,
    growth=0.0,
    edge_loss=0.0,
    edge_mix=0.0,
    loss=0.0,
    baseline=0.0,
    grazing=0.0,
    dark_fraction=0.0,
    border=0,
)
"""A perfect depth camera."""


@functools.lru_cache(maxsize=4)
def _normal_field(
    seed: int, height: int, width: int, channels: int, blur: float
) -> npt.NDArray[np.float32]:
    """Draws unit normal deviates (height + _SHIFTS, width + _SHIFTS[, channels])."""
    rng = np.random.default_rng([seed, height, width, channels])
    shape = (height + _SHIFTS, width + _SHIFTS, channels)
    field = rng.standard_normal(shape, dtype=np.float32)
    if blur > 0:
        field = cv2.GaussianBlur(field, (0, 0), blur).reshape(shape)
        field /= field.std()
    field = np.squeeze(field)
    field.setflags(write=False)
    return field


@functools.lru_cache(maxsize=4)
def _uniform_field(seed: int, height: int, width: int) -> npt.NDArray[np.float32]:
    rng = np.random.default_rng([seed, height, width])
    field = rng.random((height + _SHIFTS, width + _SHIFTS), dtype=np.float32)
    field.setflags(write=False)
    return field


@functools.lru_cache(maxsize=4)
def _color_field(seed: int, height: int, width: int, sigma: float) -> npt.NDArray[np.int8]:
    """Draws colour noise in grey levels; the alpha channel has none."""
    # Bypasses the cache: the field is large and used only here.
    noise = _normal_field.__wrapped__(seed, height, width, 4, 0.0) * sigma
    field = np.clip(np.rint(noise), -127, 127).astype(np.int8)
    field[..., 3] = 0
    field.setflags(write=False)
    return field


def _window(
    rng: np.random.Generator, field: npt.NDArray[np.generic], height: int, width: int
) -> npt.NDArray:
    row, column = rng.integers(_SHIFTS, size=2)
    return field[row : row + height, column : column + width]


def apply_color_noise(
    rgba: npt.NDArray[np.uint8],
    intrinsics: CameraIntrinsics,
    noise: ColorNoise,
    *,
    seed: int,
    frame: int,
) -> npt.NDArray[np.uint8]:
    """Applies the real camera's lens distortion and noise to a perfect colour image.

    Args:
        rgba: Rendered image (height, width, 4), or a multiple of that size, which is averaged over
            blocks of pixels: a sensor's pixel gathers light over its whole area, a renderer's
            samples one point.
        intrinsics: The camera; its distortion is applied.
        noise: The noise.
        seed: Seed of the camera's noise.
        frame: Number of the frame.

    Returns:
        A new image (height, width, 4).
    """
    if rgba.shape[1] > intrinsics.width:
        size = (intrinsics.width, intrinsics.height)
        rgba = cv2.resize(rgba, size, interpolation=cv2.INTER_AREA)
    if intrinsics.is_distorted:
        coarse, fine = distortion_maps(intrinsics)
        rgba = cv2.remap(rgba, coarse, fine, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    if noise.sigma <= 0:
        return rgba.copy()
    height, width = rgba.shape[:2]
    rng = np.random.default_rng([seed, frame])
    field = _window(rng, _color_field(seed, height, width, noise.sigma), height, width)
    return cv2.add(rgba, field, dtype=cv2.CV_8U)


def apply_depth_noise(
    depth: npt.NDArray[np.float32],
    intrinsics: CameraIntrinsics,
    noise: DepthNoise,
    *,
    seed: int,
    frame: int,
) -> npt.NDArray[np.uint16]:
    """Applies the real sensor's noise and dropouts to a perfect depth image.

    Args:
        depth: Rendered depths (height, width) [m]; zero, infinite or NaN where there is none.
            Depths too near to be measured still cast shadows in the projector's light.
        intrinsics: The camera; depths outside its near and far are lost.
        noise: The noise.
        seed: Seed of the camera's noise.
        frame: Number of the frame.

    Returns:
        Depths (height, width) in whole millimetres; 0 in holes.
    """
    height, width = depth.shape
    rng = np.random.default_rng([seed, frame])
    normal = _window(rng, _normal_field(seed, height, width, 1, 0.6), height, width)
    chance = _window(rng, _uniform_field(seed, height, width), height, width)

    measured = (depth >= intrinsics.near) & (depth <= intrinsics.far)
    z = np.where(measured, depth, np.float32(0))
    noisy = quantise_depth(
        z + _random_sigma(z, intrinsics, noise) * normal,
        intrinsics,
        baseline=noise.baseline,
        step=noise.disparity_step,
    )

    # Unmeasured pixels count as far away, so that silhouettes against them are edges too.
    solid = np.where(measured, depth, np.float32(2 * intrinsics.far))
    kernel = np.ones((3, 3), np.uint8)
    nearest, farthest = cv2.erode(solid, kernel), cv2.dilate(solid, kernel)
    edge = measured & (farthest - nearest > noise.edge_jump * nearest)
    rows, columns = np.nonzero(edge)
    draw = chance[rows, columns]
    lost = draw < noise.edge_loss
    noisy[rows[lost], columns[lost]] = 0
    mixed = (draw >= noise.edge_loss) & (draw < noise.edge_loss + noise.edge_mix)
    mixed &= farthest[rows, columns] <= intrinsics.far
    rows, columns = rows[mixed], columns[mixed]
    fraction = (draw[mixed] - noise.edge_loss) / max(noise.edge_mix, 1e-9)
    low, high = nearest[rows, columns], farthest[rows, columns]
    noisy[rows, columns] = low + fraction * (high - low)

    noisy[chance > 1 - noise.loss] = 0
    noisy[projector_shadow(depth, intrinsics, noise.baseline)] = 0
    if noise.grazing > 0.0:
        # From no dropouts at this cosine to complete dropout at half of it.
        noisy[
            grazing_pixels(z, intrinsics, noise.grazing * (0.5 + 0.5 * chance).astype(np.float32))
        ] = 0
    noisy[:, width - noise.border :] = 0
    millimetres = np.rint(noisy * 1000)
    return np.where(measured & (millimetres > 0), millimetres, 0).astype(np.uint16)


def drop_dark_patches(
    depth: npt.NDArray[np.float32],
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    noise: DepthNoise,
    *,
    seed: int,
) -> npt.NDArray[np.float32]:
    """Removes surfaces too dark or too shiny to be measured from a depth image.

    Args:
        depth: Rendered depths (height, width) [m].
        intrinsics: The camera.
        X_WC: Its pose: patches are fixed in W.
        noise: The noise.
        seed: Seed of the patches.

    Returns:
        (height, width) [m], 0 in the patches.
    """
    if noise.dark_fraction <= 0.0:
        return depth
    dark = dark_patches(depth, intrinsics, X_WC, share=noise.dark_fraction, seed=seed)
    return np.where(dark, np.float32(0.0), depth)


def _random_sigma(
    z: npt.NDArray[np.float32], intrinsics: CameraIntrinsics, noise: DepthNoise
) -> npt.NDArray[np.floating]:
    """Returns the standard deviation of all depth noise except quantisation [m]."""
    sigma = noise.sigma(z)
    rounding = quantisation_sigma(z, intrinsics, baseline=noise.baseline, step=noise.disparity_step)
    return np.sqrt(np.maximum(np.square(sigma) - np.square(rounding), 0.0))
