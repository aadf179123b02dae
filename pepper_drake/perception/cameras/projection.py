"""Compiled projection of points into an image; the distortion is OpenCV's rational model.

u = f_x x' + c_x and v = f_y y' + c_y, where x', y' are the distorted coordinates of x = X / Z,
y = Y / Z (documentation of OpenCV's calib3d).
"""

import numpy as np
import numpy.typing as npt

from pepper_drake.compiled import compiled

Vector = npt.NDArray[np.float64]


@compiled
def pixel_at(x: float, y: float, numbers: Vector) -> tuple[float, float]:
    """Returns the pixel coordinates of a point (x, y, 1) in the camera frame.

    Args:
        x: Along image x.
        y: Along image y.
        numbers: (12,) of the camera; see `CameraIntrinsics.numbers`.
    """
    fx, fy, cx, cy, k1, k2, p1, p2, k3, k4, k5, k6 = numbers
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    radial = radial / (1 + r2 * (k4 + r2 * (k5 + r2 * k6)))
    u = fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx
    v = fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + cy
    return u, v


@compiled
def project_points(p_CP: Vector, numbers: Vector) -> Vector:
    """Returns the pixel coordinates (N, 2) of points (N, 3) [m]; NaN at or behind the camera."""
    found = np.full((len(p_CP), 2), np.nan)
    for n in range(len(p_CP)):
        z = p_CP[n, 2]
        if z > 0.0:
            found[n, 0], found[n, 1] = pixel_at(p_CP[n, 0] / z, p_CP[n, 1] / z, numbers)
    return found
