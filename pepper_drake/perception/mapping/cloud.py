"""Converts a depth image to the points of obstacles in the world frame.

The depth image is subsampled before it is projected, to save time.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from pydrake.perception import BaseField, Fields, PointCloud

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import CameraIntrinsics, pixel_rays, ray_lengths
from pepper_drake.perception.mapping.solids import SolidSet
from pepper_drake.short_repr import short_repr, short_signature

Array = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]

_MANY, _NEAREST_MM = 0.05, 150
"""If more than this fraction of an image is measured, and all of it nearer than this, its integers
are not millimetres, as no depth camera measures so near."""

_FARTHEST_ROOM = 100.0
"""Median depth beyond the range of any depth camera [m]."""


@dataclass(unsafe_hash=True)
class CloudParameters:
    """Parameters of clouds made from depth images.

    Attributes:
        stride: Stride of the pixels used along both axes, ...
        largest_spacing: ... except where they would be farther apart in depth than this [m].
        max_range: Largest distance from the camera [m].
        floor_height: Points below this height in W belong to the floor [m].
        flying_slope: Steepest slope of a surface, as change of depth over change along the image;
            steeper is a jump between two surfaces.
        flying_noise: Standard deviation of the depth at 1 m [m]; it grows with the square of depth.
        flying_neighbours: Smallest number of the eight neighbouring pixels on the same surface.
        object_margin: Points closer than this to the goal object belong to it [m]; ...
        object_lag: ... the margin grows by the object's displacement in this time [s], half image
            period, half filters, ...
        largest_object_lag: ... but by no more than this [m].
        robot_margin: Points closer than this to the robot's collision shapes belong to it [m].
        smooth_spread: Largest relative difference of inverse depths of 5x5 pixels on one surface.
    """

    stride: int = 2
    largest_spacing: float = 0.008
    max_range: float = 1.5
    floor_height: float = 0.03
    flying_slope: float = 4.0
    flying_noise: float = 0.0025
    flying_neighbours: int = 4
    object_margin: float = 0.015
    object_lag: float = 0.3
    largest_object_lag: float = 0.06
    robot_margin: float = 0.02
    smooth_spread: float = 0.15

    __repr__ = short_repr
    __signature__ = short_signature


@dataclass(frozen=True)
class SurfacePoints:
    """Points on surfaces.

    Attributes:
        positions: (N, 3) [m], in W.
        normals: (N, 3) unit normals towards the camera, in W; NaN where unknown.
    """

    positions: Array
    normals: Array

    __repr__ = short_repr

    def select(self, mask: Mask) -> "SurfacePoints":
        """Returns the points selected by a mask (N,)."""
        if mask.all():
            return self
        return SurfacePoints(self.positions[mask], self.normals[mask])


def depth_in_metres(
    depth: npt.NDArray[np.generic], intrinsics: CameraIntrinsics, *, scale: float | None = None
) -> Array:
    """Converts a depth image to float32 metres with 0 for holes.

    Args:
        depth: (height, width[, 1]) of any integer or floating-point type. Holes are values of 0 or
            less, NaN, infinity, or the drivers' integer codes 65535 and 2047.
        intrinsics: The camera; depths outside its near and far are dropped.
        scale: Unit of the image [m]; if omitted, a millimetre for integers and a metre for
            floating-point numbers.

    Returns:
        (height, width); (0, 0) for an image without pixels.

    Raises:
        InputError: If it has another size than the camera or more than one channel, or its values
            are implausible in their unit.
    """
    if depth.ndim == 3 and depth.shape[2] == 1:
        depth = depth[..., 0]
    if depth.size == 0:
        return np.zeros((0, 0), np.float32)
    if depth.dtype.kind not in "iuf" or depth.ndim != 2:
        raise InputError(
            f"depth image: {depth.dtype} of shape {depth.shape} cannot be read; give one channel "
            "of whole or floating numbers."
        )
    if depth.shape != (intrinsics.height, intrinsics.width):
        raise InputError(
            f"depth image: is {depth.shape[1]}x{depth.shape[0]}, but the camera's intrinsics are "
            f"those of {intrinsics.width}x{intrinsics.height}; give the image's own, or scale them "
            "with CameraIntrinsics.resized."
        )
    whole = depth.dtype.kind in "iu"
    if scale is not None and not 0.0 < scale < np.inf:
        raise InputError(f"depth image: its scale {scale} must be a positive length [m].")
    _check_unit(depth, whole, scale)
    if scale is None:
        scale = 0.001 if whole else 1.0
    metres = depth.astype(np.float32)
    metres *= np.float32(scale)
    with np.errstate(invalid="ignore"):
        measured = (metres >= intrinsics.near) & (metres <= intrinsics.far)
    if whole:
        measured &= ~hole_codes(depth)
    metres[~measured] = 0
    return metres


def hole_codes(depth: npt.NDArray[np.generic]) -> Mask:
    """Tells which whole numbers of a depth image are the drivers' codes of holes."""
    return np.asarray((depth == 65535) | (depth == 2047))


def _check_unit(depth: npt.NDArray[np.generic], whole: bool, scale: float | None) -> None:
    """Raises InputError if values are implausible in their unit: the scale, else mm or m."""
    values = depth[::7, ::7].astype(np.float64)
    with np.errstate(invalid="ignore"):
        values = values[np.isfinite(values) & (values > 0)]
    if whole:
        values = values[~hole_codes(values)]
        near = values.size > _MANY * depth.size / 49 and values.max() < _NEAREST_MM
        if scale is None and (depth.dtype.itemsize == 1 or near):
            raise InputError(
                f"depth image: {depth.dtype} is too coarse for millimetres; give its "
                "scale, the length of its unit in metres."
            )
    unit = scale or (0.001 if whole else 1.0)
    if values.size and unit * float(np.median(values)) > _FARTHEST_ROOM:
        raise InputError(
            f"depth image: {depth.dtype} counts as units of {unit:g} m, but half of it is farther "
            f"than {_FARTHEST_ROOM:g} m; give its scale, such as 0.001 for millimetres."
        )


def surface_pixels(depth: Array, intrinsics: CameraIntrinsics, parameters: CloudParameters) -> Mask:
    """Finds the pixels on surfaces, as opposed to flying pixels between two surfaces.

    A pixel is on a surface when enough of its neighbours have the same depth, within noise and the
    slope of a surface seen at a grazing angle.

    Args:
        depth: (height, width) [m], 0 for holes.
        intrinsics: The camera.
        parameters: Slope, noise and number of neighbours.

    Returns:
        (height, width).
    """
    tolerance = depth * np.float32(parameters.flying_slope / intrinsics.focal_x)
    tolerance += np.square(depth) * np.float32(4.5 * parameters.flying_noise)
    count = np.zeros(depth.shape, np.uint8)
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        rows, rows_next = slice(0, depth.shape[0] - down), slice(down, None)
        if right >= 0:
            columns, columns_next = slice(0, depth.shape[1] - right), slice(right, None)
        else:
            columns, columns_next = slice(-right, None), slice(0, right)
        here, there = (rows, columns), (rows_next, columns_next)
        close = np.abs(depth[here] - depth[there]) <= tolerance[here]
        count[here] += close
        count[there] += close
    return (count >= parameters.flying_neighbours) & (depth > 0)


def inverse_depth_gradient(
    depth: Array, intrinsics: CameraIntrinsics, spread: float = CloudParameters.smooth_spread
) -> tuple[Array, Array]:
    """Computes the gradient (d/dx, d/dy) of the inverse depth 1/z.

    (x, y) is the pixel's ray at unit depth. A plane's inverse depth is linear in it; the gradient
    is that of the plane fitted to 5x5 pixels.

    Args:
        depth: (height, width) [m], 0 for holes.
        intrinsics: The camera; its distortion is neglected.
        spread: Largest relative difference of inverse depths on one surface.

    Returns:
        Two images (height, width) [1/m]; NaN where the 5x5 pixels are not all on one surface.
    """
    inverse = np.divide(np.float32(1), depth, out=np.zeros_like(depth), where=depth > 0)
    ramp, flat = np.arange(-2, 3, dtype=np.float32), np.ones(5, np.float32)
    gradient_x = cv2.sepFilter2D(inverse, cv2.CV_32F, ramp * (intrinsics.focal_x / 50), flat)
    gradient_y = cv2.sepFilter2D(inverse, cv2.CV_32F, flat, ramp * (intrinsics.focal_y / 50))
    kernel = np.ones((5, 5), np.uint8)
    # Pixels beyond the border count as holes.
    lowest = cv2.erode(inverse, kernel, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    highest = cv2.dilate(inverse, kernel)
    jump = (lowest <= 0) | (highest > (1 + spread) * lowest)
    gradient_x[jump] = np.nan
    gradient_y[jump] = np.nan
    return gradient_x, gradient_y


def thin_pixels(
    depth: Array,
    gradient: tuple[Array, Array],
    intrinsics: CameraIntrinsics,
    parameters: CloudParameters,
) -> Mask:
    """Selects every `stride`-th row and column, and all pixels where a surface is steep.

    On a table top seen from just above it, neighbouring rows are a centimetre or more apart, so all
    are used; also at edges, where many pixels are lost.

    Args:
        depth: (height, width) [m], 0 for holes.
        gradient: Gradient of the inverse depth, from `inverse_depth_gradient`.
        intrinsics: The camera.
        parameters: Stride and largest spacing.

    Returns:
        (height, width).
    """
    stride = parameters.stride
    chosen = np.ones(depth.shape, dtype=bool)
    if stride == 1:
        return chosen
    # dz per pixel = z^2 d(1/z)/dx / f.
    steep = np.square(depth) * np.float32(stride / parameters.largest_spacing)
    for axis, (slope, focal) in enumerate(
        zip(gradient, (intrinsics.focal_x, intrinsics.focal_y), strict=True)
    ):
        on_grid = np.arange(depth.shape[1 - axis]) % stride == stride // 2
        on_grid = on_grid[None, :] if axis == 0 else on_grid[:, None]
        with np.errstate(invalid="ignore"):
            chosen &= on_grid | ~(np.abs(slope) * steep <= focal)
    return chosen


def observe_surfaces(
    depth: Array,
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    parameters: CloudParameters,
) -> SurfacePoints:
    """Projects a depth image to the points of all surfaces except the floor.

    Args:
        depth: From `depth_in_metres`.
        intrinsics: The camera.
        X_WC: Its pose when the image was taken.
        parameters: Stride, range, floor and flying pixels.

    Returns:
        Points in W.
    """
    if depth.size == 0:
        return SurfacePoints(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.float32))
    gradient = inverse_depth_gradient(depth, intrinsics, parameters.smooth_spread)
    kept = thin_pixels(depth, gradient, intrinsics, parameters)
    kept &= surface_pixels(depth, intrinsics, parameters)
    kept &= depth * ray_lengths(intrinsics) <= parameters.max_range
    pixels = np.flatnonzero(kept)
    rays = pixel_rays(intrinsics).reshape(-1, 3)[pixels]
    z = depth.ravel()[pixels]
    R_WC = X_WC.rotation().matrix().astype(np.float32)
    p_W = (rays * z[:, None]) @ R_WC.T + X_WC.translation().astype(np.float32)
    above = p_W[:, 2] >= parameters.floor_height
    pixels, rays, z = pixels[above], rays[above], z[above]
    # The plane a x + b y + c = 1/z through the point has the normal (a, b, c), away from C.
    a, b = gradient[0].ravel()[pixels], gradient[1].ravel()[pixels]
    normals = -np.stack([a, b, 1 / z - a * rays[:, 0] - b * rays[:, 1]], axis=1)
    normals /= np.sqrt(np.einsum("ij,ij->i", normals, normals))[:, None]
    return SurfacePoints(p_W[above], normals @ R_WC.T)


def remove_solids(surface: SurfacePoints, solids: SolidSet, margin: float) -> SurfacePoints:
    """Removes the points in or near some solids, such as the goal object or the robot itself.

    Args:
        surface: The points.
        solids: What to remove, in W.
        margin: Distance up to which points belong to a solid [m].
    """
    return surface.select(~solids.near(surface.positions, margin))


def to_point_cloud(surface: SurfacePoints, X_FW: RigidTransform | None = None) -> PointCloud:
    """Returns surface points as Drake's PointCloud with normals.

    Args:
        surface: The points, in W.
        X_FW: Pose of W in the cloud's frame F; F is W if omitted.
    """
    positions, normals = surface.positions, surface.normals
    if X_FW is not None:
        R_FW = X_FW.rotation().matrix().astype(np.float32)
        positions = positions @ R_FW.T + X_FW.translation().astype(np.float32)
        normals = normals @ R_FW.T
    cloud = PointCloud(len(positions), Fields(BaseField.kXYZs | BaseField.kNormals))
    if len(positions):
        cloud.mutable_xyzs()[:] = positions.T
        cloud.mutable_normals()[:] = normals.T
    return cloud
