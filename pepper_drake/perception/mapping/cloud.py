"""From a depth image to the points of obstacles in the world frame.

The depth image is thinned first and projected then: what is not projected costs nothing.
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
"""If more than this share of an image is measured, and all of it nearer than this, the whole
numbers are no millimetres: no depth camera measures there."""

_FARTHEST_ROOM = 100.0
"""No depth camera sees farther, by half of its pixels [m]."""


@dataclass(unsafe_hash=True)
class CloudParameters:
    """Parameters of clouds made from depth images.

    Attributes:
        stride: Every how many-th pixel is used along both axes, ...
        largest_spacing: ... but all where the used ones would be this far apart in depth [m].
        max_range: Farthest distance from the camera [m].
        floor_height: What lies lower than this in W is floor [m].
        flying_slope: Steepest surface, as change of depth over change along the image, that is
            told from a jump between two surfaces.
        flying_noise: Standard deviation of the depth at 1 m [m]; it grows with the square of depth.
        flying_neighbours: Least number of the eight neighbouring pixels on the same surface.
        object_margin: What is closer than this to the goal object belongs to it [m], ...
        object_lag: ... and what it may have moved in this time [s]: half between images, half in
            filters, ...
        largest_object_lag: ... but no more than this [m].
        robot_margin: What is closer than this to the robot's collision shapes belongs to it [m].
        smooth_spread: Inverse depths of 5x5 pixels on one surface differ by at most this share.
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
        normals: (N, 3) of unit length towards the camera, in W; NaN where they are not known.
    """

    positions: Array
    normals: Array

    __repr__ = short_repr

    def select(self, mask: Mask) -> "SurfacePoints":
        """Returns those of a mask (N,)."""
        if mask.all():
            return self
        return SurfacePoints(self.positions[mask], self.normals[mask])


def depth_in_metres(
    depth: npt.NDArray[np.generic], intrinsics: CameraIntrinsics, *, scale: float | None = None
) -> Array:
    """Returns a depth image as float32 metres with 0 wherever nothing was measured.

    Args:
        depth: (height, width[, 1]) of any integer or floating type. Nothing was measured where it
            is 0 or less, NaN, infinite, or in whole numbers 65535 or 2047, by which drivers say so.
        intrinsics: The camera; depths outside its near and far are dropped.
        scale: Length of the image's unit [m]; a millimetre for whole numbers and a metre for
            floating ones when left out.

    Returns:
        (height, width); (0, 0) for an image without pixels.

    Raises:
        InputError: If it has another size than the camera or more than one channel, or its values
            cannot be what they should without a scale.
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
        measured &= (depth != 65535) & (depth != 2047)
    metres[~measured] = 0
    return metres


def _check_unit(depth: npt.NDArray[np.generic], whole: bool, scale: float | None) -> None:
    """Raises if an image cannot be in its unit: by its scale, else mm (whole numbers) or m."""
    values = depth[::7, ::7].astype(np.float64)
    with np.errstate(invalid="ignore"):
        values = values[np.isfinite(values) & (values > 0)]
    if whole:
        values = values[(values != 65535) & (values != 2047)]
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
    """Tells the pixels that lie on a surface from those that fly between two.

    A pixel lies on a surface when enough of its neighbours have its depth, but for noise and as
    much slope as a surface seen at a grazing angle has.

    Args:
        depth: (height, width), m, 0 where there is none.
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
    """Computes how the inverse depth changes along the image: (d/dx, d/dy) of 1/z.

    (x, y) is the pixel's ray at unit depth. A plane's inverse depth is linear in it; the gradient
    is that of the plane fitted to 5x5 pixels.

    Args:
        depth: (height, width), m, 0 where there is none.
        intrinsics: The camera; its distortion is neglected.
        spread: Share by which inverse depths on one surface differ at most.

    Returns:
        Two images (height, width), 1/m; NaN where the 5x5 pixels are not all on one surface.
    """
    inverse = np.divide(np.float32(1), depth, out=np.zeros_like(depth), where=depth > 0)
    ramp, flat = np.arange(-2, 3, dtype=np.float32), np.ones(5, np.float32)
    gradient_x = cv2.sepFilter2D(inverse, cv2.CV_32F, ramp * (intrinsics.focal_x / 50), flat)
    gradient_y = cv2.sepFilter2D(inverse, cv2.CV_32F, flat, ramp * (intrinsics.focal_y / 50))
    kernel = np.ones((5, 5), np.uint8)
    # Beyond the border nothing is known.
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
    """Chooses every `stride`-th row and column, and all where a surface is seen edge-on.

    On a table top seen from just above it, neighbouring rows are a centimetre or more apart: there
    none can be spared. Nor at edges, where many pixels are lost.

    Args:
        depth: (height, width), m, 0 where there is none.
        gradient: Of the inverse depth, from `inverse_depth_gradient`.
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
    """Projects a depth image to the points of all surfaces but the floor.

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
        X_FW: Pose of W in the frame that the cloud shall be in; W when left out.
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
