"""ArUco markers: detection in an image, and the pose of a square marker from its corners.

The marker frame M has its origin at the centre of the black square, x to the right and y up on the
printed face, z out of it.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.cameras.images import to_gray
from pepper_drake.perception.goal.marker_edges import marker_edges, refine_on_edges
from pepper_drake.perception.goal.marker_params import DEFAULT_MARKER, MarkerParams

MARKER_DICTIONARY = "DICT_4X4_50"


_LARGEST_SIDE = 2.0
"""Largest plausible side of a goal's marker [m]."""


_WORTHLESS = 10.0
"""Reprojection error above which OpenCV's initial guess is useless [pixels], as for a marker that
is exactly parallel to the image plane with its sides along the image's."""

_NUDGE = np.array([[[1e-3, 0.0]], [[0.0, 0.0]], [[0.0, 0.0]], [[0.0, 1e-3]]])
"""Perturbation of corners that breaks this degeneracy [pixels]."""


@dataclass(frozen=True)
class Detection:
    """A marker found in an image.

    Attributes:
        id: Its number in the dictionary.
        corners: Pixel coordinates (4, 2) of the printed marker's top left, top right, bottom right
            and bottom left corner.
        corner_sigma: Upper bound of the standard deviation of a corner's coordinate [pixels].
        grain: Noise of the surrounding image relative to its contrast, 0 if unknown.
        softness: Contrast divided by the steepest slope of its edges [pixels], 0 if unknown.
        clipped: Saturated fraction of the white pixels around it.
    """

    id: int
    corners: npt.NDArray[np.float64]
    corner_sigma: float = 0.2
    grain: float = 0.0
    softness: float = 0.0
    clipped: float = 0.0

    @property
    def side(self) -> float:
        """Returns the length of its shortest side [pixels]."""
        return float(np.linalg.norm(self.corners - np.roll(self.corners, 1, axis=0), axis=1).min())


@dataclass(frozen=True)
class MarkerPose:
    """One of the (up to two) poses that explain a marker's corners.

    Attributes:
        X_CM: Pose of the marker in the camera frame.
        reprojection_error: Root mean square reprojection error of the corners, or of the pattern's
            edges [pixels].
        covariance: Covariance (6, 6) of rotation (rad, axes of C) and position (m, in C).
        on_edges: Whether the pose was fitted to all edges of the pattern.
        corner_sigma: Standard deviation of a corner's coordinate [pixels].
    """

    X_CM: RigidTransform
    reprojection_error: float
    covariance: npt.NDArray[np.float64]
    on_edges: bool = False
    corner_sigma: float = 0.2


@functools.lru_cache(maxsize=32)
def marker_dictionary(name: str) -> cv2.aruco.Dictionary:
    """Returns one of OpenCV's marker dictionaries by name.

    Raises:
        InputError: If the name is unknown.
    """
    number = getattr(cv2.aruco, name, None)
    if not (name.startswith("DICT_") and isinstance(number, int)):
        raise InputError(
            f"marker dictionary {name!r} is unknown; OpenCV's are named like "
            f'"{MARKER_DICTIONARY}".'
        )
    return cv2.aruco.getPredefinedDictionary(number)


def check_marker(name: str, marker_id: int) -> None:
    """Raises InputError if a dictionary is unknown or has no marker of that number."""
    count = len(marker_dictionary(name).bytesList)
    if not 0 <= marker_id < count:
        raise InputError(
            f"marker id {marker_id} is not in {name}, which has 0 to {count - 1}; name the "
            "dictionary that the marker was printed from."
        )


@functools.lru_cache(maxsize=4)
def _detector(dictionary: str) -> cv2.aruco.ArucoDetector:
    """Makes a detector with few false positives and precise corners."""
    parameters = cv2.aruco.DetectorParameters()
    # Line fits to the edges instead of subpixel corners: a tenth of the depth error.
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_APRILTAG
    # Without these two, sensor noise is taken for edges, and a frame takes 100 ms.
    parameters.aprilTagMinWhiteBlackDiff = 25
    parameters.aprilTagQuadSigma = 0.8
    return cv2.aruco.ArucoDetector(marker_dictionary(dictionary), parameters)


@functools.lru_cache(maxsize=4)
def _second_detector(dictionary: str) -> cv2.aruco.ArucoDetector:
    """Makes a detector for small, dark or overexposed markers, with less precise corners."""
    parameters = cv2.aruco.DetectorParameters()
    parameters.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    return cv2.aruco.ArucoDetector(marker_dictionary(dictionary), parameters)


def detect_markers(
    image: npt.NDArray[Any],
    *,
    dictionary: str = MARKER_DICTIONARY,
    window: tuple[int, int, int, int] | None = None,
    wanted: int | None = None,
    params: MarkerParams = DEFAULT_MARKER,
) -> list[Detection]:
    """Finds the markers in an image.

    A second, more sensitive detector is used if the first finds nothing.

    Args:
        image: Image of any kind that `to_gray` accepts; an empty one has no markers.
        dictionary: Name of an OpenCV dictionary.
        window: Part of the image to search, (left, top, right, bottom) in pixels, right and
            bottom exclusive; all of it if omitted.
        wanted: Id of the wanted marker: if the first detector misses it, the second is used, too.
        params: Smallest marker, and the noise of corners.

    Returns:
        The markers, in no particular order; several may have the same id.
    """
    if image.size == 0:
        return []
    left, top = 0, 0
    if window is not None:
        height, width = image.shape[:2]
        left, top = max(window[0], 0), max(window[1], 0)
        right, bottom = min(window[2], width), min(window[3], height)
        if right - left < 2 * params.smallest_side or bottom - top < 2 * params.smallest_side:
            return []
        image = image[top:bottom, left:right]
    gray = np.ascontiguousarray(to_gray(image))
    # The first detector has the centre of the first pixel at 0.5.
    corner = np.array([left, top], dtype=float)
    found = _detections(_detector(dictionary), gray, corner - 0.5, params.corner_sigma, params)
    if found and (wanted is None or any(detection.id == wanted for detection in found)):
        return found
    second = _second_detector(dictionary)
    return found + _detections(second, gray, corner, params.second_corner_sigma, params)


_IMMERKAER = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)


def _detections(
    detector: cv2.aruco.ArucoDetector,
    gray: npt.NDArray[np.uint8],
    shift: npt.NDArray[np.float64],
    corner_sigma: float,
    params: MarkerParams,
) -> list[Detection]:
    corners, ids, _ = detector.detectMarkers(gray)
    if ids is None:
        return []
    found = [
        Detection(
            int(number),
            quad.reshape(4, 2).astype(float) + shift,
            **_condition(gray, quad.reshape(4, 2), params),
        )
        for number, quad in zip(np.ravel(ids), corners, strict=True)
    ]
    return [
        _with_sigma(detection, corner_sigma, params)
        for detection in found
        if detection.side >= params.smallest_side
    ]


def _condition(
    gray: npt.NDArray[np.uint8], corners: npt.NDArray[np.float32], params: MarkerParams
) -> dict[str, float]:
    """Returns grain, softness and clipping of a quadrilateral; see `Detection`.

    The noise is estimated with Immerkaer's mask (1996, "Fast Noise Variance Estimation",
    doi:10.1006/cviu.1996.0060), by the median because of the marker's edges.
    """
    low, high = corners.min(axis=0), corners.max(axis=0)

    def around(share: float) -> npt.NDArray[np.float32]:
        left, top = np.maximum(low - share * (high - low), 0).astype(int)
        right, bottom = (high + share * (high - low)).astype(int) + 1
        return gray[top:bottom, left:right].astype(np.float32)

    dark, bright = np.percentile(around(0.0), (10, 90))
    residual = cv2.filter2D(around(1.0), -1, _IMMERKAER)
    noise = np.median(np.abs(residual)) / (0.6745 * 6.0)
    near = around(0.3)
    black, white = np.percentile(near, (5, 95))
    slope = np.hypot(cv2.Sobel(near, -1, 1, 0), cv2.Sobel(near, -1, 0, 1)) / 8.0
    return {
        "grain": float(noise / max(bright - dark, 1.0)),
        "softness": float((white - black) / max(np.percentile(slope, 95), 1e-3)),
        "clipped": float(np.mean(near[near >= 0.5 * (black + white)] >= params.saturation_level)),
    }


def _with_sigma(detection: Detection, corner_sigma: float, params: MarkerParams) -> Detection:
    """Sets the corners' standard deviation; for small markers it is the same for all detectors."""
    if detection.side < params.small_side:
        corner_sigma = params.second_corner_sigma * params.small_side / detection.side
    return replace(detection, corner_sigma=corner_sigma)


def check_side(size: float) -> None:
    """Raises InputError for an impossible side of a marker [m]."""
    if not 0.0 < size <= _LARGEST_SIDE:
        raise InputError(
            f"marker size {size} must be the side of its black square in metres, at most "
            f"{_LARGEST_SIDE:g}."
        )


def marker_corners(size: float) -> npt.NDArray[np.float64]:
    """Returns the corners (4, 3) of a marker of side `size` [m] in the marker frame."""
    check_side(size)
    h = size / 2
    return np.array([[-h, h, 0.0], [h, h, 0.0], [h, -h, 0.0], [-h, -h, 0.0]])


def marker_poses(
    corners: npt.NDArray[np.float64],
    size: float,
    intrinsics: CameraIntrinsics,
    *,
    corner_sigma: float = 0.2,
    corner_covariance: npt.NDArray[np.float64] | None = None,
    params: MarkerParams = DEFAULT_MARKER,
) -> list[MarkerPose]:
    """Computes the poses that explain a marker's corners, the better one first.

    A distant plane has two poses with nearly the same image (Collins and Bartoli 2014,
    "Infinitesimal Plane-Based Pose Estimation", doi:10.1007/s11263-014-0725-5). Both are returned,
    each refined to minimal reprojection error.

    Args:
        corners: Pixel coordinates (4, 2) in the order of `Detection.corners`.
        size: Side of the black square [m].
        intrinsics: The camera, with its distortion.
        corner_sigma: Standard deviation of a corner's coordinate [pixels].
        corner_covariance: Covariance (8, 8) of all coordinates, corner by corner [pixels^2];
            independent coordinates if omitted.
        params: Largest error of a pose.

    Returns:
        One or two poses; none if no square projects to these corners.
    """
    if corner_covariance is None:
        corner_covariance = corner_sigma**2 * np.eye(8)
    model = marker_corners(size)
    matrix, distortion = intrinsics.matrix, intrinsics.distortion_coefficients
    image_points = np.ascontiguousarray(corners, dtype=float).reshape(4, 1, 2)
    for nudge in (0.0, _NUDGE):
        count, rotations, translations, errors = cv2.solvePnPGeneric(
            model, image_points + nudge, matrix, distortion, flags=cv2.SOLVEPNP_IPPE_SQUARE
        )
        if count and errors[0] <= _WORTHLESS:
            break
    poses: list[MarkerPose] = []
    for k in range(count):
        rotation, translation = cv2.solvePnPRefineLM(
            model, image_points, matrix, distortion, rotations[k], translations[k]
        )
        if not (np.all(np.isfinite(rotation)) and translation[2, 0] > 0):
            continue
        projected, jacobian = cv2.projectPoints(model, rotation, translation, matrix, distortion)
        error = float(np.sqrt(np.mean(np.sum((projected - image_points) ** 2, axis=2))))
        R_CM = RotationMatrix(cv2.Rodrigues(rotation)[0])
        if error > params.largest_error or R_CM.col(2) @ translation[:, 0] >= 0:
            continue
        pose_by_corners = np.linalg.pinv(jacobian[:, :6])
        covariance = pose_by_corners @ corner_covariance @ pose_by_corners.T
        if not any(_angle(R_CM, other.X_CM.rotation()) < 0.02 for other in poses):
            X_CM = RigidTransform(R_CM, translation[:, 0])
            poses.append(MarkerPose(X_CM, error, covariance, corner_sigma=corner_sigma))
    return sorted(poses, key=lambda pose: pose.reprojection_error)


def corner_covariance(
    detection: Detection, params: MarkerParams = DEFAULT_MARKER
) -> npt.NDArray[np.float64]:
    """Returns the covariance (8, 8) of a detection's corners, corner by corner [pixels^2]."""
    own = detection.corner_sigma**2 * np.eye(8)
    outwards = detection.corners - detection.corners.mean(axis=0)
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    inwards, common = np.outer(outwards, outwards), np.tile(np.eye(2), (4, 4)) / 4
    is_soft = detection.side < params.largest_soft_side
    softer = max(detection.softness - params.sharp, 0.0) if is_soft else 0.0
    clipped = detection.clipped if is_soft else 0.0

    def blurred(by_softness: float, by_clipping: float) -> float:
        return (by_softness * softer) ** 2 + (by_clipping * clipped) ** 2

    bias = blurred(params.shrinkage_by_softness, params.shrinkage_by_clipping) * inwards
    bias += blurred(params.shift_by_softness, params.shift_by_clipping) * common
    if detection.side >= params.small_side:
        return own + bias
    shrinkage, shift, scatter = (
        (by_side / detection.side) ** 2 + (by_noise * detection.grain) ** 2
        for by_side, by_noise in (
            (params.shrinkage_by_side, params.shrinkage_by_noise),
            (params.shift_by_side, params.shift_by_noise),
            (params.scatter_by_side, params.scatter_by_noise),
        )
    )
    return shift * common + scatter * (np.eye(8) - common) + shrinkage * inwards + bias


def detection_poses(
    detection: Detection,
    size: float,
    intrinsics: CameraIntrinsics,
    params: MarkerParams = DEFAULT_MARKER,
) -> list[MarkerPose]:
    """Computes the poses that explain a detection, with its corner errors; see `marker_poses`.

    Args:
        detection: The marker found.
        size: Side of the black square [m].
        intrinsics: The camera, with its distortion.
        params: Noise of the corners.
    """
    return marker_poses(
        detection.corners,
        size,
        intrinsics,
        corner_sigma=detection.corner_sigma,
        corner_covariance=corner_covariance(detection, params),
        params=params,
    )


def refine_poses(
    image: npt.NDArray[Any],
    poses: Sequence[MarkerPose],
    marker_id: int,
    size: float,
    intrinsics: CameraIntrinsics,
    *,
    dictionary: str = MARKER_DICTIONARY,
    params: MarkerParams = DEFAULT_MARKER,
) -> list[MarkerPose]:
    """Fits poses to all edges of the marker's pattern.

    Args:
        image: Image of any kind that `to_gray` accepts.
        poses: Result of `marker_poses`. The second is dropped if it is clearly worse.
        marker_id: The marker's number.
        size: Side of the black square [m].
        intrinsics: The camera.
        dictionary: Name of an OpenCV dictionary.
        params: Search for the edges, and disambiguation of two poses.

    Returns:
        The refined poses, the better one first, without those whose pattern is not seen. Poses of
        a marker that is too small in the image are returned unchanged.
    """
    if len(poses) > 1 and is_better(poses[0], poses[1], params):
        poses = poses[:1]
    gray, edges = to_gray(image), marker_edges(dictionary, marker_id)
    refined = []
    for pose in poses:
        fit = refine_on_edges(gray, pose.X_CM, edges, size, intrinsics, params=params.edges)
        if fit is None:
            refined.append(pose)
        elif fit.support >= params.edges.min_support:
            refined.append(MarkerPose(fit.X_CM, fit.error, fit.covariance, on_edges=True))
    return sorted(refined, key=lambda pose: pose.reprojection_error)


def choose_pose(
    poses: Sequence[MarkerPose],
    X_WC: RigidTransform,
    X_OM: RigidTransform,
    *,
    R_WO_last: RotationMatrix | None = None,
    params: MarkerParams = DEFAULT_MARKER,
) -> MarkerPose | None:
    """Chooses between a marker's two poses.

    If the reprojection errors differ clearly, the smaller one decides. Otherwise it is the pose
    closest to the object's last orientation, or without one, that with the object's z axis closest
    to upright.

    Args:
        poses: Result of `marker_poses`.
        X_WC: Pose of the camera.
        X_OM: Pose of the marker on the object.
        R_WO_last: The object's last known orientation.
        params: Disambiguation of two poses.

    Returns:
        The chosen pose; None if there is none.
    """
    if not poses:
        return None
    if len(poses) == 1:
        return poses[0]
    best, other = poses[:2]
    if is_better(best, other, params):
        return best

    def implausibility(pose: MarkerPose) -> float:
        R_WO = (X_WC @ pose.X_CM @ X_OM.inverse()).rotation()
        if R_WO_last is not None:
            return _angle(R_WO, R_WO_last)
        return -float(R_WO.col(2)[2])

    return min((best, other), key=implausibility)


def is_better(best: MarkerPose, other: MarkerPose, params: MarkerParams = DEFAULT_MARKER) -> bool:
    """Tells whether the reprojection errors alone determine which of two poses is right."""
    least, error = max(best.reprojection_error, 0.02), other.reprojection_error
    if best.on_edges and other.on_edges:
        return error > params.edges.ambiguity_ratio * least
    noise = params.ambiguity_sigmas * best.corner_sigma
    return error > params.ambiguity_ratio * least and error**2 > least**2 + noise**2


def _angle(R1: RotationMatrix, R2: RotationMatrix) -> float:
    """Returns the angle between two orientations [rad]."""
    cosine = (np.sum(R1.matrix() * R2.matrix()) - 1) / 2
    return float(np.arccos(np.clip(cosine, -1, 1)))
