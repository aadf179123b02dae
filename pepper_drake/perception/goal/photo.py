"""Markers in a single photo: poses of a known marker, or identities of unknown ones."""

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
"""OpenCV's dictionaries in which an unknown marker is searched for: the largest of each family,
which contains the smaller ones."""


@dataclass(frozen=True)
class MarkerSighting:
    """A marker in a photo.

    Attributes:
        detection: Its corners.
        pose: Its most likely pose X_CM in the camera frame.
        other: The other pose if it is ambiguous, else None.
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
    """Finds all markers with a given number in a photo.

    Args:
        image: The photo, of any kind that `to_gray` accepts.
        intrinsics: The camera that took it.
        marker_id: The marker's number.
        size: Side of its black square [m].
        dictionary: Name of OpenCV's dictionary.
        order: Order of the photo's colours.

    Returns:
        The sightings, in no particular order.

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
    """Identifies the markers of any dictionary in a photo, by dictionary and number.

    If several dictionaries match a marker, the first is returned.

    Args:
        image: The photo, of any kind that `to_gray` accepts.
        order: Order of its colours.
        dictionaries: Names of OpenCV's dictionaries to search.
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
