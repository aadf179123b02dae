"""Textures, painted or projected, that make plain surfaces matchable.

Both are computed from a rendered image and its perfect depth image, like a shader.
"""

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.perception.cameras.camera import CameraIntrinsics, pixel_rays


def value_noise(points: npt.NDArray[np.floating], seed: int) -> npt.NDArray[np.float32]:
    """Returns value noise: a lattice of random numbers, interpolated linearly.

    Args:
        points: (N, 2) or (N, 3); the lattice has spacing 1.
        seed: Seed of the lattice.

    Returns:
        (N,), in [0, 1].
    """
    dimensions = points.shape[1]
    base = np.floor(points)
    fraction = (points - base).astype(np.float32)
    cell = base.astype(np.int64)
    total = np.zeros(len(points), np.float32)
    for corner in np.ndindex(*(2,) * dimensions):
        weight = np.ones(len(points), np.float32)
        key = np.full(len(points), seed * 2_654_435_761 + 97, np.uint64)
        for axis, step in enumerate(corner):
            weight *= fraction[:, axis] if step else 1 - fraction[:, axis]
            key = (key ^ (cell[:, axis] + step).astype(np.uint64)) * np.uint64(
                0x9E3779B97F4A7C15 + 2 * axis
            )
            key ^= key >> np.uint64(29)
        total += weight * ((key >> np.uint64(40)).astype(np.float32) / np.float32(1 << 24))
    return total


def paint_texture(
    image: npt.NDArray[np.uint8],
    depth: npt.NDArray[np.floating],
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    *,
    grain: float = 0.006,
    contrast: float = 0.95,
    seed: int = 0,
    painted: npt.NDArray[np.bool_] | None = None,
) -> npt.NDArray[np.uint8]:
    """Paints a speckled texture, fixed in the world, on the surfaces of a rendered image.

    Args:
        image: Rendered image (height, width, channels), without lens distortion.
        depth: Its perfect depths (height, width) [m].
        intrinsics: The camera; its distortion is not applied yet.
        X_WC: Its pose.
        grain: Size of the finer speckles [m]; the coarser ones are three times as large.
        contrast: Largest fraction by which a surface is darkened.
        seed: Seed of the texture.
        painted: Mask of the pixels to paint (height, width); all with a surface if omitted.
    """
    rays = pixel_rays(intrinsics.ideal())
    where = np.isfinite(depth) & (depth > 0)
    if painted is not None:
        where &= painted
    p_W = (rays[where] * depth[where][:, None]) @ X_WC.rotation().matrix().T + X_WC.translation()
    fine = value_noise(p_W / grain, seed)
    coarse = value_noise(p_W / (3 * grain), seed + 1)
    return _darken(image, where, contrast * (0.6 * fine + 0.4 * coarse))


def project_pattern(
    image: npt.NDArray[np.uint8],
    depth: npt.NDArray[np.floating],
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    X_WP: RigidTransform,
    *,
    grain: float = 0.008,
    contrast: float = 0.6,
    seed: int = 0,
) -> npt.NDArray[np.uint8]:
    """Projects a random pattern on the scene from a projector beside the cameras.

    The projector's shadows are neglected: next to the cameras they are hardly visible.

    Args:
        image: Rendered image (height, width, channels), without lens distortion.
        depth: Its perfect depths (height, width) [m].
        intrinsics: The camera; its distortion is not applied yet.
        X_WC: Its pose.
        X_WP: The projector's pose, z along its optical axis.
        grain: Size of the pattern's dots at 1 m [m].
        contrast: Largest fraction by which a surface is darkened.
        seed: Seed of the pattern.
    """
    rays = pixel_rays(intrinsics.ideal())
    where = np.isfinite(depth) & (depth > 0)
    X_PC = X_WP.InvertAndCompose(X_WC)
    p_P = (rays[where] * depth[where][:, None]) @ X_PC.rotation().matrix().T + X_PC.translation()
    direction = p_P[:, :2] / np.maximum(p_P[:, 2:], 1e-6)
    light = value_noise(direction / grain, seed)
    return _darken(image, where, contrast * light)


def _darken(
    image: npt.NDArray[np.uint8],
    where: npt.NDArray[np.bool_],
    fraction: npt.NDArray[np.floating],
) -> npt.NDArray[np.uint8]:
    """Darkens the colours of some pixels by a fraction; an alpha channel is unchanged."""
    result = image.copy()
    colors = result[where][:, :3].astype(np.float32)
    faded = result[where]
    faded[:, :3] = np.rint(colors * (1 - np.asarray(fraction, np.float32)[:, None]))
    result[where] = faded
    return result
