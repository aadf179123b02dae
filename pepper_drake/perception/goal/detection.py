"""Measures the goal object's pose in one colour image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Box, Cylinder
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.errors import InputError
from pepper_drake.models.markers import plate_size
from pepper_drake.models.scene import GoalObject
from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.cameras.images import to_gray
from pepper_drake.perception.goal.imm_filter import GoalMeasurement
from pepper_drake.perception.goal.marker import (
    MARKER_DICTIONARY,
    Detection,
    check_marker,
    check_side,
    choose_pose,
    detect_markers,
    detection_poses,
    refine_poses,
)
from pepper_drake.perception.goal.marker_params import DEFAULT_MARKER, MarkerParams
from pepper_drake.perception.mapping.solids import Solid
from pepper_drake.short_repr import short_repr


@dataclass(frozen=True)
class MarkedObject:
    """An object with a marker.

    Attributes:
        marker_id: The marker's number in its dictionary.
        marker_size: Side of the marker's black square [m].
        X_OM: Pose of the marker (x right, y up, z out of the printed face) on the object. The
            object's z axis is up when the object stands upright.
        solids: The object's shape in its frame O, to remove it from clouds.
        dictionary: Name of OpenCV's dictionary.
    """

    marker_id: int
    marker_size: float
    X_OM: RigidTransform
    solids: tuple[Solid, ...] = ()
    dictionary: str = MARKER_DICTIONARY

    __repr__ = short_repr

    def __post_init__(self) -> None:
        check_marker(self.dictionary, self.marker_id)
        check_side(self.marker_size)

    @classmethod
    def from_scene(cls, goal: GoalObject) -> MarkedObject:
        """Returns a scene's goal object: a cylinder with its marker on a plate."""
        X_OM = goal.marker.pose()
        edge, thickness = plate_size(goal.marker.size), 0.004
        plate = Box(edge, edge, thickness)
        return cls(
            goal.marker.id,
            goal.marker.size,
            X_OM,
            (
                Solid(Cylinder(goal.radius, goal.height), RigidTransform([0, 0, goal.height / 2])),
                Solid(plate, X_OM @ RigidTransform([0, 0, -thickness / 2])),
            ),
        )


def detect_goal(
    image: npt.NDArray[Any],
    time: float,
    X_WC: RigidTransform,
    intrinsics: CameraIntrinsics,
    marked: MarkedObject,
    *,
    p_WM_expected: npt.NDArray[np.float64] | None = None,
    R_WO_expected: RotationMatrix | None = None,
    params: MarkerParams = DEFAULT_MARKER,
) -> GoalMeasurement | None:
    """Detects the goal object's marker in an image and measures the object's pose.

    Args:
        image: Image of any kind that `to_gray` accepts; an empty one has no marker.
        time: Capture time [s].
        X_WC: The camera's pose at that time.
        intrinsics: The camera.
        marked: The object to look for.
        p_WM_expected: Expected position of the marker [m]: its neighbourhood is searched first, and
            of several markers with the object's id the nearest is used.
        R_WO_expected: Expected orientation of the object, which decides between ambiguous poses.
        params: Detection, noise and choice of poses.

    Returns:
        The measurement; None when the marker is not seen, or seen several times without an expected
        position.

    Raises:
        InputError: If the image has another size than the camera, or is not an image.
    """
    if image.size == 0:
        return None
    check_image_size(image, intrinsics)
    image = to_gray(image)
    window = None
    if p_WM_expected is not None:
        window = _expected_window(
            X_WC.inverse() @ p_WM_expected, intrinsics, marked.marker_size, params
        )
    found = _find(image, marked, window, params) if window is not None else []
    if not found:
        found = _find(image, marked, None, params)
    choices = []
    for detection in found:
        poses = refine_poses(
            image,
            detection_poses(detection, marked.marker_size, intrinsics, params),
            marked.marker_id,
            marked.marker_size,
            intrinsics,
            dictionary=marked.dictionary,
            params=params,
        )
        pose = choose_pose(poses, X_WC, marked.X_OM, R_WO_last=R_WO_expected, params=params)
        if pose is not None:
            choices.append(pose)
    if not choices or (len(choices) > 1 and p_WM_expected is None):
        return None

    def distance(pose_index: int) -> float:
        p_WM = X_WC @ choices[pose_index].X_CM.translation()
        return float(np.linalg.norm(p_WM - p_WM_expected))

    pose = choices[min(range(len(choices)), key=distance) if len(choices) > 1 else 0]
    X_WM = X_WC @ pose.X_CM
    R_WC = X_WC.rotation().matrix()
    systematic = params.systematic_ratio * (R_WC @ pose.X_CM.translation())
    systematic_covariance = np.outer(systematic, systematic)
    return GoalMeasurement(
        time,
        X_WM.translation(),
        (X_WM @ marked.X_OM.inverse()).rotation(),
        R_WC @ pose.covariance[3:, 3:] @ R_WC.T + systematic_covariance,
        float(np.trace(pose.covariance[:3, :3])) / 3,
        systematic_covariance,
    )


def check_image_size(image: npt.NDArray[Any], intrinsics: CameraIntrinsics) -> None:
    """Raises InputError for an image of another size than the camera's."""
    if image.ndim not in (2, 3):
        raise InputError(f"image: shape {image.shape} is not (height, width[, channels]).")
    height, width = image.shape[:2]
    if (width, height) != (intrinsics.width, intrinsics.height):
        raise InputError(
            f"image: is {width}x{height}, but the camera's intrinsics are those of "
            f"{intrinsics.width}x{intrinsics.height}; give the calibration of such images, "
            "or scale it (CameraIntrinsics.resized)."
        )


def _find(
    image: npt.NDArray[np.uint8],
    marked: MarkedObject,
    window: tuple[int, int, int, int] | None,
    params: MarkerParams,
) -> list[Detection]:
    found = detect_markers(
        image, dictionary=marked.dictionary, window=window, wanted=marked.marker_id, params=params
    )
    return [detection for detection in found if detection.id == marked.marker_id]


def _expected_window(
    p_CM: npt.NDArray[np.float64],
    intrinsics: CameraIntrinsics,
    size: float,
    params: MarkerParams,
) -> tuple[int, int, int, int] | None:
    """Returns the image window around a marker expected at p_CM; None if it is out of view."""
    if p_CM[2] <= 0 or not intrinsics.sees(p_CM):
        return None
    u, v = intrinsics.project(p_CM)
    reach = math.ceil(
        params.window_ratio * intrinsics.focal_x * size / p_CM[2] + params.window_margin
    )
    return (int(u) - reach, int(v) - reach, int(u) + reach, int(v) + reach)
