"""Pixels that a structured-light depth camera cannot measure.

Such a camera compares the image of an infrared pattern with what its projector throws. The
projector sits beside the camera: what a nearer surface keeps in the projector's shadow is not
measured. Neither is a surface that throws too little of the pattern back, since it is dark, shiny
or seen at a grazing angle, nor the last columns, where the compared window leaves the image.
"""

import functools

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from scipy.ndimage import gaussian_filter

from pepper_drake.perception.cameras.camera import CameraIntrinsics, pixel_rays, ray_lengths

Array = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]

_SHADOW_STEP = 0.04
"""Least step in depth between a surface and what lies in its shadow [m]."""
_NEAREST = 0.1
"""Depth below which the displacement of the pattern is not followed [m]."""
_PATCH_CELLS = 128
"""Edge of the cube of reflectances that fills space periodically [cells], a power of two."""
_PATCH_CELL = 0.01
"""Edge of one of its cells [m]."""
_PATCH_BLUR = 2.0
"""Standard deviation of the Gaussian that gives patches their size [cells]."""


def projector_displacement(
    depth: npt.NDArray[np.floating], focal_x: float, baseline: float
) -> npt.NDArray[np.floating]:
    """Computes how far the pattern on a surface is displaced along the image: f b / z [pixels].

    Args:
        depth: Depths [m], any shape; all positive.
        focal_x: Focal length along image x [pixels].
        baseline: Place of the projector along the camera's x axis [m].
    """
    return (focal_x * baseline) / np.maximum(depth, _NEAREST)


def projector_shadow(depth: Array, intrinsics: CameraIntrinsics, baseline: float) -> Mask:
    """Finds the pixels that the projector does not light, since something nearer is in between.

    The depth image is projected into the projector's image and kept there with the least depth of
    each column and row, as a z-buffer does.

    Args:
        depth: True depths (height, width) [m]; zero, infinite or NaN where there is no surface.
            What is too near to be measured casts a shadow too, if its depth is given.
        intrinsics: The camera; its distortion is neglected.
        baseline: Place of the projector along the camera's x axis [m]. If it is positive, shadows
            are to the left of things.

    Returns:
        (height, width); False where there is no surface.
    """
    height, width = depth.shape
    with np.errstate(invalid="ignore"):
        surface = (depth > 0.0) & (depth < np.inf)
    if baseline == 0.0 or not surface.any():
        return np.zeros(depth.shape, dtype=bool)
    reach = int(np.ceil(abs(intrinsics.focal_x * baseline) / _NEAREST)) + 1
    wide = width + 2 * reach
    z = np.where(surface, depth, np.float32(intrinsics.far))
    shift = projector_displacement(z, intrinsics.focal_x, baseline)
    columns = np.rint(np.arange(width, dtype=np.float32) - shift).astype(np.int64) + reach
    index = columns + wide * np.arange(height)[:, None]
    nearest = np.full(height * wide, np.inf, np.float32)
    np.minimum.at(nearest, index[surface], z[surface])
    # A surface that faces the projector is seen wider by it than by the camera.
    closed = cv2.erode(nearest.reshape(height, wide), np.ones((1, 3), np.uint8)).ravel()
    return np.asarray(surface & (z > closed[index] + _SHADOW_STEP))


def incidence_cosine(depth: Array, intrinsics: CameraIntrinsics) -> Array:
    """Computes the cosine of the angle between each pixel's ray and its surface's normal.

    Args:
        depth: Depths (height, width) [m]; zero, infinite or NaN where there is no surface.
        intrinsics: The camera.

    Returns:
        (height, width), within [0, 1]; 1 where there is no surface. At a step between two surfaces
        it is that of the steep plane through both.
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        inverse = np.where(depth > 0.0, 1.0 / depth, np.float32(0.0)).astype(np.float32)
    kernel = np.array([[-0.5, 0.0, 0.5]], np.float32)
    a = cv2.filter2D(inverse, cv2.CV_32F, kernel * intrinsics.focal_x)
    b = cv2.filter2D(inverse, cv2.CV_32F, kernel.T * intrinsics.focal_y)
    rays = pixel_rays(intrinsics)
    # A plane a x + b y + c = 1/z has the normal (a, b, c); along the ray it measures 1/z.
    c = inverse - a * rays[..., 0] - b * rays[..., 1]
    length = np.sqrt(a * a + b * b + c * c) * ray_lengths(intrinsics)
    return np.divide(inverse, length, out=np.ones_like(inverse), where=inverse > 0.0)


@functools.lru_cache(maxsize=4)
def _patches(seed: int, share: float) -> npt.NDArray[np.bool_]:
    """Cells of a periodic cube that are in dark patches (n, n, n)."""
    rng = np.random.default_rng([seed, _PATCH_CELLS])
    field = rng.standard_normal((_PATCH_CELLS,) * 3, dtype=np.float32)
    field = gaussian_filter(field, _PATCH_BLUR, mode="wrap")
    dark = field > np.quantile(field, 1.0 - share)
    dark.setflags(write=False)
    return dark


def dark_patches(
    depth: Array, intrinsics: CameraIntrinsics, X_WC: RigidTransform, *, share: float, seed: int
) -> Mask:
    """Finds the pixels on patches that throw nothing back; patches stay where they are in W.

    The patches are about 4 cm wide and drawn once for a seed: where the excursions of a smooth
    Gaussian random field in W are highest.

    Args:
        depth: True depths (height, width) [m]; zero, infinite or NaN where there is no surface.
        intrinsics: The camera.
        X_WC: Its pose.
        share: Share of all surfaces that is dark, within [0, 1).
        seed: Decides where they are.

    Returns:
        (height, width).
    """
    if share <= 0.0:
        return np.zeros(depth.shape, dtype=bool)
    with np.errstate(invalid="ignore"):
        surface = (depth > 0.0) & (depth < np.inf)
    z = np.where(surface, depth, np.float32(0.0))
    scale = np.float32(1.0 / _PATCH_CELL)
    R = X_WC.rotation().matrix().astype(np.float32) * scale
    p = X_WC.translation().astype(np.float32) * scale
    rays = pixel_rays(intrinsics)
    index = np.zeros(depth.shape, np.int32)
    for k in range(3):
        along = rays[..., 0] * R[k, 0] + rays[..., 1] * R[k, 1] + R[k, 2]
        cell = np.floor(along * z + p[k]).astype(np.int32) & (_PATCH_CELLS - 1)
        index = index * _PATCH_CELLS + cell
    return np.asarray(surface & _patches(seed, share).ravel()[index])


def quantise_depth(
    depth: Array, intrinsics: CameraIntrinsics, *, baseline: float, step: float
) -> Array:
    """Rounds depths to what whole steps of the pattern's displacement stand for.

    Args:
        depth: Depths (height, width) [m]; 0 where there is none.
        intrinsics: The camera.
        baseline: Distance of projector and camera [m].
        step: Least difference of displacements that is told apart [pixels].

    Returns:
        Depths (height, width) [m].
    """
    reach = np.float32(intrinsics.focal_x * abs(baseline))
    if reach == 0.0 or step <= 0.0:
        return depth
    unit = np.float32(reach / step)
    with np.errstate(divide="ignore", invalid="ignore"):
        steps = np.rint(unit / depth)
        return np.where((depth > 0.0) & (steps > 0.0), unit / steps, np.float32(0.0))


def quantisation_sigma(
    depth: npt.NDArray[np.floating], intrinsics: CameraIntrinsics, *, baseline: float, step: float
) -> npt.NDArray[np.floating]:
    """Standard deviation of the rounding of `quantise_depth` [m]: z^2 step / (f b sqrt(12)).

    Args:
        depth: Depths [m], any shape.
        intrinsics: The camera.
        baseline: Distance of projector and camera [m].
        step: Least difference of displacements that is told apart [pixels].
    """
    reach = intrinsics.focal_x * abs(baseline)
    if reach == 0.0:
        return np.zeros_like(depth)
    return np.square(depth) * (step / (reach * np.sqrt(12.0)))
