"""Markers in a single photo: poses, or their identities if not those that were looked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.cameras.images import to_gray
from pepper_drake.perception.goal.detection import check_image_size
from pepper_drake.perception.goal.marker import (
    MARKER_DICTIONARY,
    Detection,
    MarkerPose,
    check_marker,
    detect_markers,
    detection_poses,
    is_better,
    refine_poses,
)
from pepper_drake.short_repr import short_repr

DICTIONARIES = (
    "DICT_ARUCO_ORIGINAL",
    "DICT_7X7_1000",
    "DICT_6X6_1000",
    "DICT_5X5_1000",
    "DICT_APRILTAG_36h11",
    "DICT_APRILTAG_36h10",
    "DICT_ARUCO_MIP_36h12",
    "DICT_APRILTAG_25h9",
    "DICT_4X4_1000",
)
"""OpenCV's dictionaries in which a marker of unknown origin is looked for, the largest of each
family, which holds the smaller ones."""


@dataclass(frozen=True)
class MarkerSighting:
    """A marker in a photo.

    Attributes:
        detection: Its corners.
        pose: Its most likely pose X_CM in the camera frame.
        other: The other pose that explains it as well, if there is one.
    """

    detection: Detection
    pose: MarkerPose
    other: MarkerPose | None

    __repr__ = short_repr


def find_in_photo(
    image: npt.NDArray[Any],
    intrinsics: CameraIntrinsics,
    marker_id: int,
    size: float,
    *,
    dictionary: str = MARKER_DICTIONARY,
    order: str = "bgr",
) -> list[MarkerSighting]:
    """Finds all markers of a number in a photo.

    Args:
        image: The photo, of any kind that `to_gray` takes.
        intrinsics: The camera that took it.
        marker_id: The marker's number.
        size: Side of its black square [m].
        dictionary: Name of OpenCV's dictionary.
        order: Of the photo's colours.

    Returns:
        One for each marker, in no particular order.

    Raises:
        InputError: If the photo has another size than the camera, or there is no such marker.
    """
    check_marker(dictionary, marker_id)
    check_image_size(image, intrinsics)
    gray = to_gray(image, order=order)
    sightings = []
    for detection in detect_markers(gray, dictionary=dictionary, wanted=marker_id):
        if detection.id != marker_id:
            continue
        poses = detection_poses(detection, size, intrinsics)
        poses = refine_poses(gray, poses, marker_id, size, intrinsics, dictionary=dictionary)
        if poses:
            alike = len(poses) > 1 and not is_better(poses[0], poses[1])
            sightings.append(MarkerSighting(detection, poses[0], poses[1] if alike else None))
    return sightings


def markers_shown(
    image: npt.NDArray[Any], *, order: str = "bgr", dictionaries: Sequence[str] = DICTIONARIES
) -> list[tuple[str, int]]:
    """Tells which markers of any dictionary a photo shows, as dictionary and number.

    Where several dictionaries find one, the first is named.

    Args:
        image: The photo, of any kind that `to_gray` takes.
        order: Of its colours.
        dictionaries: Names of OpenCV's dictionaries to look in.
    """
    gray = to_gray(image, order=order)
    found: list[tuple[str, int]] = []
    places: list[npt.NDArray[np.float64]] = []
    for name in dictionaries:
        for detection in detect_markers(gray, dictionary=name):
            middle = detection.corners.mean(axis=0)
            if all(np.linalg.norm(middle - place) > detection.side / 2 for place in places):
                found.append((name, detection.id))
                places.append(middle)
    return found
