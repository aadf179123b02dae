"""Depth images of a wall, made without a renderer."""

import numpy as np

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH, pixel_rays

CAMERA = CAMERA_DEPTH.intrinsics
SHAPE = (CAMERA.height, CAMERA.width)
ROWS, COLUMNS = np.indices(SHAPE)


def wall(z=1.2):
    return np.full(SHAPE, z, np.float32)


def disc(p_C, radius):
    """Pixels of a ball at a place in the camera frame."""
    u, v = CAMERA.project(np.array(p_C))
    r = radius / p_C[2] * CAMERA.focal_x
    return (COLUMNS - u) ** 2 + (ROWS - v) ** 2 < r**2


def places(mask, z=1.2):
    """The middle of squares of a mask's pixels, on a wall (N, 3) [m]."""
    rays = pixel_rays(CAMERA)[3::6, 3::6].reshape(-1, 3)
    return (z * rays)[mask[3::6, 3::6].ravel()]
