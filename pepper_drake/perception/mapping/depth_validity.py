"""Validity of depth images.

A failed camera must not be mistaken for free space, nor a frozen one for a scene at rest.
"""

import enum
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.perception.cameras.camera import CameraIntrinsics, pixel_rays
from pepper_drake.short_repr import short_signature

Array = npt.NDArray[np.float32]


class DepthFault(enum.IntEnum):
    """Reason why a depth image is invalid."""

    NONE = 0
    MISSING = 1
    """There is none, or it has no pixels."""
    LATE = 2
    """Its time stamp is not a number, in the future, or not after the last one's."""
    FROZEN = 3
    """Its pixels are identical to the last one's."""
    WRONG_SIZE = 4
    """It has another size than the camera."""
    BLANK = 5
    """It shows nothing where floor or known objects are expected."""
    CONSTANT = 6
    """All pixels have the same depth."""
    BELOW_FLOOR = 7
    """Much of it lies below the floor."""
    CONTRADICTS_MAP = 8
    """It contradicts much of the known scene."""
    WRONG_SCALE = 9
    """It shows the goal object nearer or farther than its marker does."""
    WRONG_UNIT = 10
    """Its numbers cannot be millimetres."""
    NOISE = 11
    """Its pixels are not those of surfaces, but unrelated to their neighbours."""


FAULT_SENTENCES = {
    DepthFault.NONE: "the depth camera's images are used",
    DepthFault.MISSING: "the depth camera gave no image",
    DepthFault.LATE: "the depth camera's time stamp stands, or is not of the present",
    DepthFault.FROZEN: "the depth camera gives the same image again and again",
    DepthFault.WRONG_SIZE: "the depth camera gives images of another size than its own",
    DepthFault.BLANK: "the depth camera's images show nothing at all",
    DepthFault.CONSTANT: "all pixels of the depth camera's images have the same value",
    DepthFault.BELOW_FLOOR: "the depth camera's images show points below the floor",
    DepthFault.CONTRADICTS_MAP: "the depth camera's images contradict what was seen before",
    DepthFault.WRONG_SCALE: "the depth camera and the goal object's marker disagree on how far it "
    "is: the camera's scale is wrong, or the stated size of the marker",
    DepthFault.WRONG_UNIT: "the depth camera's images are not in millimetres",
    DepthFault.NOISE: "the depth camera's images are noise: their pixels do not fit together",
}

_NOTHING = (0, 2047, 65535, np.inf)
"""Values by which cameras and drivers mark holes."""
_FLOOR_STRIDE = 8
"""Stride of the pixels checked for the floor."""
_NOISE_STRIDE = 2
"""Stride of the rows in which neighbouring pixels are compared."""
_NEIGHBOURS = 8
"""Largest distance of neighbours, between which there may be holes [pixels]."""


@dataclass(unsafe_hash=True)
class ValidityParameters:
    """Parameters of checking depth images.

    Attributes:
        margin: Largest difference of consistent depths [m], ...
        growth: ... and its growth per metre of depth.
        contradicted: Fraction of contradicted points at which the image contradicts the map.
        min_points: Smallest number of points for that decision.
        min_expected_points: Smallest number of expected points, of known objects and floor, for an
            image to count as blank.
        expects_noise: Whether identical images mean a frozen camera, as real sensors are noisy. If
            not, they do only after the camera has moved.
        shows_all: Whether every visible surface is measured. If not, as with a stereo pair whose
            images are segmented, an image may be blank.
        floor_depth: Depth up to which the floor is always measured [m].
        min_shown_fraction: Fraction of the expected points below which an image is blank.
        scale_error_spread: Spread of the relative depth errors below which they are due to a wrong
            scale.
        scale_error: Largest relative error of the goal object's depth.
        noise: Fraction of neighbouring pixels on two surfaces above which an image is noise.
            Measured: up to 0.02; 0.2 and more if the bytes of its numbers are exchanged, and 0.8
            if they are random.
        surface_step: Largest difference of neighbouring depths on one surface, relative to the
            nearer one.
        moved: Displacement at which a frame has moved [m], above the noise of measured joints, ...
        turned: ... or rotation at which it has [rad].
    """

    __signature__ = short_signature

    margin: float = 0.05
    growth: float = 0.04
    contradicted: float = 0.6
    min_points: int = 300
    min_expected_points: int = 40
    expects_noise: bool = True
    shows_all: bool = True
    floor_depth: float = 2.0
    min_shown_fraction: float = 0.03
    scale_error_spread: float = 0.04
    scale_error: float = 0.07
    noise: float = 0.15
    surface_step: float = 0.15
    moved: float = 0.002
    turned: float = 0.004


def image_fault(
    image: npt.NDArray[np.generic],
    last: npt.NDArray[np.generic] | None,
    intrinsics: CameraIntrinsics,
    *,
    moved: bool,
    parameters: ValidityParameters,
) -> DepthFault:
    """Checks a raw depth image by itself, and against the previous one.

    A blank image is left to `depth_fault`, as it may be correct in an empty hall.

    Args:
        image: Depth image (height, width[, 1]) of any integer or floating-point type.
        last: The previous image; None if there is none.
        intrinsics: The camera.
        moved: Whether the camera has moved in between.
        parameters: Parameters of the check.

    Returns:
        MISSING, WRONG_SIZE, FROZEN, CONSTANT or NONE.
    """
    if image.size == 0:
        return DepthFault.MISSING
    if image.ndim == 3 and image.shape[2] == 1:
        image = image[..., 0]
    if image.shape != (intrinsics.height, intrinsics.width):
        return DepthFault.WRONG_SIZE
    first = image[0, 0]
    # NaN is not equal to itself.
    if bool((image == first).all()) or not bool((image == image).any()):
        # `depth_fault` decides whether it should show something.
        empty = first != first or first in _NOTHING
        return DepthFault.NONE if empty else DepthFault.CONSTANT
    if last is not None and (moved or parameters.expects_noise):
        if last.ndim == 3 and last.shape[2] == 1:
            last = last[..., 0]
        # NaN pixels count as identical.
        if last.dtype == image.dtype and last.shape == image.shape:
            floating = image.dtype.kind == "f"
            if bool(np.array_equal(image, last, equal_nan=floating)):
                return DepthFault.FROZEN
    return DepthFault.NONE


def depth_fault(
    depth: Array,
    X_WC: RigidTransform,
    known: npt.NDArray[np.floating],
    intrinsics: CameraIntrinsics,
    parameters: ValidityParameters,
) -> DepthFault:
    """Checks a depth image against the floor and against earlier images.

    Args:
        depth: Depth image (height, width) [m], 0 for holes.
        X_WC: The camera's pose; z = 0 in W is the floor.
        known: Points (P, 3) on surfaces that were seen often, in W [m], without the robot.
        intrinsics: The camera.
        parameters: Parameters of the check.

    Returns:
        BLANK, NOISE, BELOW_FLOOR, CONTRADICTS_MAP or NONE.
    """
    if parameters.shows_all and _is_blank(depth, X_WC, known, intrinsics, parameters):
        return DepthFault.BLANK
    if _is_noise(depth, parameters):
        return DepthFault.NOISE
    if lies_below_floor(depth, X_WC, intrinsics, parameters):
        return DepthFault.BELOW_FLOOR
    off, z = _depth_changes(depth, X_WC, known, intrinsics)
    if len(z) < parameters.min_points:
        return DepthFault.NONE
    allowed = parameters.margin + parameters.growth * z
    if np.mean(off > allowed) > parameters.contradicted:
        return DepthFault.CONTRADICTS_MAP
    # Nearer points may be a new obstacle, unless all are nearer by the same factor.
    low, middle, high = np.quantile(off / z, [0.2, 0.5, 0.8])
    if (
        np.mean(-off > allowed) > parameters.contradicted
        and high - low < parameters.scale_error_spread
    ):
        return DepthFault.CONTRADICTS_MAP
    # Nothing moves all of a scene by the same factor.
    if abs(middle) > parameters.scale_error and high - low < 0.5 * parameters.scale_error_spread:
        return DepthFault.CONTRADICTS_MAP
    return DepthFault.NONE


def _depth_changes(
    depth: Array,
    X_WC: RigidTransform,
    known: npt.NDArray[np.floating],
    intrinsics: CameraIntrinsics,
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Returns measured less known depth of M known points in view, and the known one (M,) [m]."""
    p_C, rows, columns = _in_view(known, X_WC, intrinsics)
    # An unchanged surface shows its depth in at least one of nine pixels.
    off = np.full(len(p_C), np.inf)
    for down in (-2, 0, 2):
        for right in (-2, 0, 2):
            z = depth[rows + down, columns + right]
            other = np.where(z > 0.0, z - p_C[:, 2], np.inf)
            off = np.where(np.abs(other) < np.abs(off), other, off)
    measured_points = np.isfinite(off)
    return off[measured_points], p_C[measured_points, 2]


def _in_view(
    p_W: npt.NDArray[np.floating], X_WC: RigidTransform, intrinsics: CameraIntrinsics
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Returns the measurable points (N, 3) in C [m], off the border, with rows and columns."""
    p_C = (np.asarray(p_W, dtype=float) - X_WC.translation()) @ X_WC.rotation().matrix()
    p_C = p_C[(p_C[:, 2] > intrinsics.near) & (p_C[:, 2] < intrinsics.far)]
    p_C = p_C[intrinsics.sees(p_C, margin=2.0)]
    columns, rows = np.rint(intrinsics.project(p_C)).astype(np.int64).T
    return p_C, rows, columns


def _is_blank(
    depth: Array,
    X_WC: RigidTransform,
    known: npt.NDArray[np.floating],
    intrinsics: CameraIntrinsics,
    parameters: ValidityParameters,
) -> bool:
    """Tells whether almost nothing was measured where known objects and floor are expected."""
    rays = pixel_rays(intrinsics, _FLOOR_STRIDE).reshape(-1, 3).astype(float)
    down = rays @ X_WC.rotation().matrix()[2]
    p_WC = X_WC.translation()
    on_floor = down * parameters.floor_depth < -p_WC[2]
    if p_WC[2] <= 0.0:
        on_floor[:] = False
    start = _FLOOR_STRIDE // 2
    measured = (depth > 0).astype(np.uint8)
    around = cv2.dilate(measured, np.ones((5, 5), np.uint8)) > 0
    floor = around[start::_FLOOR_STRIDE, start::_FLOOR_STRIDE].ravel()[on_floor]
    _, rows, columns = _in_view(known, X_WC, intrinsics)
    shown = np.concatenate((floor, around[rows, columns]))
    return (
        len(shown) >= parameters.min_expected_points
        and float(np.mean(shown)) < parameters.min_shown_fraction
    )


def _is_noise(depth: Array, parameters: ValidityParameters) -> bool:
    """Tells whether too many neighbouring pixels lie on two surfaces, in rows and in columns.

    Bars are smooth along themselves.
    """
    for lines in (depth[::_NOISE_STRIDE], depth[:, ::_NOISE_STRIDE].T):
        pixels = np.flatnonzero(lines)
        z, near = lines.ravel()[pixels], np.diff(pixels) <= _NEIGHBOURS
        if np.count_nonzero(near) < parameters.min_points:
            return False
        step = np.abs(np.diff(z)) / np.minimum(z[:-1], z[1:])
        if not np.mean(step[near] > parameters.surface_step) > parameters.noise:
            return False
    return True


def lies_below_floor(
    depth: Array,
    X_WC: RigidTransform,
    intrinsics: CameraIntrinsics,
    parameters: ValidityParameters,
) -> bool:
    """Tells whether much of a depth image lies below the floor, as with a wrong unit.

    Args:
        depth: Depth image (height, width) [m], 0 for holes.
        X_WC: The camera's pose; z = 0 in W is the floor.
        intrinsics: The camera.
        parameters: Margins and fraction.
    """
    stride = 6
    z = depth[stride // 2 :: stride, stride // 2 :: stride]
    slope = pixel_rays(intrinsics, stride) @ X_WC.rotation().matrix()[2].astype(np.float32)
    measured_points = z > 0.0
    if np.count_nonzero(measured_points) * stride**2 < parameters.min_points:
        return False
    height = float(X_WC.translation()[2]) + slope[measured_points] * z[measured_points]
    allowed = parameters.margin + parameters.growth * z[measured_points]
    return bool(np.mean(height < -allowed) > parameters.contradicted)
