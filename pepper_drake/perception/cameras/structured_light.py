"""Pixels that a structured-light depth camera cannot measure.

Such a camera compares the image of an infrared pattern with the projected one. The projector is
beside the camera, so nearer surfaces cast shadows in which nothing is measured. Nor are surfaces
that reflect too little of the pattern, being dark, shiny or seen at a grazing angle, and the last
columns, where the matching window leaves the image.
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
"""Smallest depth difference between a surface and the surface in its shadow [m]."""
_NEAREST = 0.1
"""Depth below which the displacement of the pattern is clipped [m]."""
_STRIDE = 2
"""Stride in pixels at which dark and grazing surfaces are evaluated."""
_BEND = 0.3
"""Largest curvature of the inverse depth on a surface, relative to its slope between pixels."""
_PATCH_CELLS = 128
"""Edge of the periodic cube of reflectances [cells], a power of two."""
_PATCH_CELL = 0.01
"""Edge of one of its cells [m]."""
_PATCH_BLUR = 2.0
"""Standard deviation of the Gaussian filter, which determines the patches' size [cells]."""


def projector_displacement(
    depth: npt.NDArray[np.floating], focal_x: float, baseline: float
) -> npt.NDArray[np.floating]:
    """Computes the pattern's displacement along the image (disparity): f b / z [pixels].

    Args:
        depth: Depths [m], any shape; all positive.
        focal_x: Focal length along image x [pixels].
        baseline: Position of the projector along the camera's x axis [m].
    """
    return (focal_x * baseline) / np.maximum(depth, _NEAREST)


def projector_shadow(depth: Array, intrinsics: CameraIntrinsics, baseline: float) -> Mask:
    """Finds the pixels in the projector's shadow.

    The depth image is projected into a z-buffer of the projector's image.

    Args:
        depth: True depths (height, width) [m]; zero, infinite or NaN where there is no surface.
            Depths too near to be measured cast shadows, too.
        intrinsics: The camera; its distortion is neglected.
        baseline: Position of the projector along the camera's x axis [m]. If it is positive,
            shadows are to the left of objects.

    Returns:
        (height, width); False where there is no surface.
    """
    shadow = np.zeros(depth.shape, dtype=bool)
    if baseline == 0.0:
        return shadow
    with np.errstate(invalid="ignore"):
        surface = (depth > 0.0) & (depth < np.inf)
    # Rows without depth discontinuities have no shadows.
    z = np.where(surface, depth, np.float32(0.0))
    chosen = np.flatnonzero(np.any(np.abs(np.diff(z, axis=1)) > _SHADOW_STEP, axis=1))
    if not len(chosen):
        return shadow
    z, surface = z[chosen], surface[chosen]
    width = depth.shape[1]
    reach = int(np.ceil(abs(intrinsics.focal_x * baseline) / _NEAREST)) + 1
    wide = width + 2 * reach
    shift = projector_displacement(z, intrinsics.focal_x, baseline).astype(np.float32)
    first = np.arange(reach, reach + width, dtype=np.float32)
    index = np.rint(first - shift).astype(np.int32)
    index += (wide * np.arange(len(chosen), dtype=np.int32))[:, None]
    nearest = np.full(len(chosen) * wide, np.inf, np.float32)
    np.minimum.at(nearest, index[surface], z[surface])
    # A surface facing the projector appears wider in its image than in the camera's.
    closed = cv2.erode(nearest.reshape(-1, wide), np.ones((1, 3), np.uint8)).ravel()
    shadow[chosen] = surface & (z > closed[index] + _SHADOW_STEP)
    return shadow


def grazing_pixels(depth: Array, intrinsics: CameraIntrinsics, cosine: Array) -> Mask:
    """Finds the pixels whose ray hits its surface at a grazing angle.

    Args:
        depth: Depths (height, width) [m]; zero, infinite or NaN where there is no surface.
        intrinsics: The camera.
        cosine: Cosine of the angle between ray and normal (height, width) below which it grazes.

    Returns:
        (height, width), constant over squares of pixels; False where a pixel and its neighbours do
        not lie in a plane.
    """
    coarse = depth[::_STRIDE, ::_STRIDE]
    with np.errstate(invalid="ignore", divide="ignore"):
        inverse = np.where(coarse > 0.0, np.float32(1.0) / coarse, np.float32(0.0))
    half = np.array([[-0.5, 0.0, 0.5]], np.float32)
    along_x, along_y = cv2.filter2D(inverse, -1, half), cv2.filter2D(inverse, -1, half.T)
    slope = np.abs(along_x) + np.abs(along_y)
    # Inverse depth is linear on a plane: at a step its second difference equals the first.
    curvature = np.abs(cv2.Laplacian(inverse, -1))
    focal_x, focal_y = intrinsics.focal_x / _STRIDE, intrinsics.focal_y / _STRIDE
    steep = (slope * np.float32(min(focal_x, focal_y)) > inverse) & (inverse > 0.0)
    grazing = np.zeros(coarse.shape, dtype=bool)
    chosen = np.nonzero(steep & (curvature <= _BEND * slope))
    if len(chosen[0]):
        w = inverse[chosen]
        a = along_x[chosen] * np.float32(focal_x)
        b = along_y[chosen] * np.float32(focal_y)
        rays = pixel_rays(intrinsics)[::_STRIDE, ::_STRIDE][chosen]
        # A plane a x + b y + c = 1/z has the normal (a, b, c); along the ray it measures 1/z.
        c = w - a * rays[:, 0] - b * rays[:, 1]
        length = np.sqrt(a * a + b * b + c * c)
        length *= ray_lengths(intrinsics)[::_STRIDE, ::_STRIDE][chosen]
        grazing[chosen] = w < cosine[::_STRIDE, ::_STRIDE][chosen] * length
    return _upsample(grazing, depth.shape)


def _upsample(coarse: Mask, shape: tuple[int, ...]) -> Mask:
    """Upsamples a mask of every `_STRIDE`-th pixel to all pixels (height, width)."""
    return coarse.repeat(_STRIDE, 0).repeat(_STRIDE, 1)[: shape[0], : shape[1]]


@functools.lru_cache(maxsize=4)
def _patches(seed: int, share: float) -> npt.NDArray[np.bool_]:
    """Returns the mask of a periodic cube's cells that are in dark patches (n, n, n)."""
    rng = np.random.default_rng([seed, _PATCH_CELLS])
    field = rng.standard_normal((_PATCH_CELLS,) * 3, dtype=np.float32)
    field = gaussian_filter(field, _PATCH_BLUR, mode="wrap")
    dark = field > np.quantile(field, 1.0 - share)
    dark.setflags(write=False)
    return dark


def dark_patches(
    depth: Array, intrinsics: CameraIntrinsics, X_WC: RigidTransform, *, share: float, seed: int
) -> Mask:
    """Finds the pixels on patches, fixed in W, that reflect too little to be measured.

    The patches are about 4 cm wide: the highest excursions of a smooth Gaussian random field in W,
    drawn once per seed.

    Args:
        depth: True depths (height, width) [m]; zero, infinite or NaN where there is no surface.
        intrinsics: The camera.
        X_WC: Its pose.
        share: Fraction of all surfaces that is dark, within [0, 1).
        seed: Seed of the patches.

    Returns:
        (height, width).
    """
    if share <= 0.0:
        return np.zeros(depth.shape, dtype=bool)
    coarse = depth[::_STRIDE, ::_STRIDE]
    with np.errstate(invalid="ignore"):
        surface = (coarse > 0.0) & (coarse < np.inf)
    z = np.where(surface, coarse, np.float32(0.0))
    scale = np.float32(1.0 / _PATCH_CELL)
    R = X_WC.rotation().matrix().astype(np.float32) * scale
    p = X_WC.translation().astype(np.float32) * scale
    p_W = (pixel_rays(intrinsics)[::_STRIDE, ::_STRIDE] * z[..., None]) @ R.T + p
    cells = np.floor(p_W).astype(np.int32) & (_PATCH_CELLS - 1)
    index = (cells[..., 0] * _PATCH_CELLS + cells[..., 1]) * _PATCH_CELLS + cells[..., 2]
    dark = surface & _patches(seed, share).ravel()[index]
    return _upsample(np.asarray(dark), depth.shape)


def quantise_depth(
    depth: Array, intrinsics: CameraIntrinsics, *, baseline: float, step: float
) -> Array:
    """Quantises depths to whole steps of the pattern's displacement.

    Args:
        depth: Depths (height, width) [m]; 0 where there is none.
        intrinsics: The camera.
        baseline: Distance of projector and camera [m].
        step: Resolution of the displacement [pixels].

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
    """Returns the standard deviation of `quantise_depth` [m]: z^2 step / (f b sqrt(12)).

    Args:
        depth: Depths [m], any shape.
        intrinsics: The camera.
        baseline: Distance of projector and camera [m].
        step: Resolution of the displacement [pixels].
    """
    reach = intrinsics.focal_x * abs(baseline)
    if reach == 0.0:
        return np.zeros_like(depth)
    return np.square(depth) * (step / (reach * np.sqrt(12.0)))
