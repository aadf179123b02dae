"""Perception on a user's own photo, depth image or cloud, with a report and files."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.cameras.image_files import read_depth, read_image, write_image
from pepper_drake.perception.cameras.images import to_8_bit
from pepper_drake.perception.goal.marker import MARKER_DICTIONARY
from pepper_drake.perception.goal.photo import MarkerSighting, find_in_photo, markers_shown
from pepper_drake.perception.mapping.cloud import (
    CloudParameters,
    depth_in_metres,
    hole_codes,
    observe_surfaces,
    to_point_cloud,
)
from pepper_drake.perception.mapping.cloud_files import load_cloud
from pepper_drake.perception.mapping.cloud_points import make_cloud
from pepper_drake.web.drake_page import offline_meshcat

_POINT_SIZE = 0.004
"""Size of the points in the page [m]."""


def report_photo(
    path: Path,
    intrinsics: CameraIntrinsics,
    marker_id: int,
    size: float,
    folder: Path,
    *,
    dictionary: str = MARKER_DICTIONARY,
) -> tuple[dict[str, Any], str]:
    """Finds a marker in a photo; writes report.json and the photo with the marker's axes.

    Args:
        path: The photo.
        intrinsics: Intrinsics of its camera.
        marker_id: The marker's number.
        size: Side of the marker's black square [m].
        folder: Folder for the results; it must exist.
        dictionary: Name of OpenCV's dictionary.

    Returns:
        The report, and a few lines for the terminal. `markers` is empty if none was found.
    """
    if not size > 0:
        raise InputError(
            f"--size {size:g} must be the side of the marker's black square in metres."
        )
    image = read_image(path)
    try:
        sightings = find_in_photo(image, intrinsics, marker_id, size, dictionary=dictionary)
    except InputError as error:
        raise InputError(f"{path}: {str(error).removeprefix('image: ')}") from None
    report: dict[str, Any] = {
        "image": str(path),
        "marker": marker_id,
        "dictionary": dictionary,
        "size": size,
        "markers": [_sighting(sighting) for sighting in sightings],
    }
    lines = []
    for found in report["markers"]:
        x, y, z = found["position"]
        lines.append(
            f"  marker {marker_id} at ({x:.4f}, {y:.4f}, {z:.4f}) m in the camera's frame, "
            f"+- {1000 * found['position_sigma']:.1f} mm; {found['side']:.0f} pixels wide"
        )
        if found["other_position"] is not None:
            lines.append("    another orientation explains it as well: see report.json")
    if not sightings:
        others = markers_shown(image)
        report["others"] = [{"dictionary": name, "id": number} for name, number in others]
        seen = ", ".join(f"{number} of {name}" for name, number in others) or "none"
        lines.append(f"  no marker {marker_id} of {dictionary}; markers that it shows: {seen}")
    _write(report, folder)
    write_image(folder / "image.png", _with_axes(image, intrinsics, sightings, size))
    return report, "\n".join(lines)


def _sighting(sighting: MarkerSighting) -> dict[str, Any]:
    pose, other = sighting.pose, sighting.other
    covariance = pose.covariance
    return {
        "corners": sighting.detection.corners.tolist(),
        "side": sighting.detection.side,
        "position": pose.X_CM.translation().tolist(),
        "quaternion": pose.X_CM.rotation().ToQuaternion().wxyz().tolist(),
        "distance": float(np.linalg.norm(pose.X_CM.translation())),
        "position_sigma": float(np.sqrt(np.trace(covariance[3:, 3:]))),
        "rotation_sigma": float(np.sqrt(np.trace(covariance[:3, :3]))),
        "reprojection_error": pose.reprojection_error,
        "other_position": None if other is None else other.X_CM.translation().tolist(),
        "other_quaternion": (
            None if other is None else other.X_CM.rotation().ToQuaternion().wxyz().tolist()
        ),
    }


def _with_axes(
    image: npt.NDArray[Any],
    intrinsics: CameraIntrinsics,
    sightings: list[MarkerSighting],
    size: float,
) -> npt.NDArray[np.uint8]:
    """Returns the photo with the axes of the markers' frames: x red, y green, z blue."""
    drawn = to_8_bit(image)
    if drawn.ndim == 2 or drawn.shape[2] == 1:
        drawn = np.asarray(cv2.cvtColor(drawn, cv2.COLOR_GRAY2BGR), np.uint8)
    drawn = np.ascontiguousarray(drawn[..., :3]).copy()
    for sighting in sightings:
        X_CM = sighting.pose.X_CM
        cv2.drawFrameAxes(
            drawn,
            intrinsics.matrix,
            intrinsics.distortion_coefficients,
            cv2.Rodrigues(X_CM.rotation().matrix())[0],
            X_CM.translation(),
            size / 2,
        )
    return drawn


def load_depth(
    path: Path, intrinsics: CameraIntrinsics, *, scale: float | None = None
) -> npt.NDArray[np.float32]:
    """Reads a depth image in metres, 0 where nothing was measured.

    Args:
        path: See `read_depth`.
        intrinsics: See `depth_in_metres`.
        scale: Length of the image's unit [m], see `depth_in_metres`.

    Raises:
        InputError: The image cannot be read, or does not fit the camera.
    """
    image = read_depth(path)
    try:
        return depth_in_metres(image, intrinsics, scale=scale)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def report_depth(
    path: Path, intrinsics: CameraIntrinsics, folder: Path, *, scale: float | None = None
) -> tuple[dict[str, Any], str]:
    """Makes a cloud from a depth image; writes report.json, cloud.npz and cloud.html.

    Args:
        path: The depth image.
        intrinsics: Intrinsics of its camera; depths outside its near and far are ignored.
        folder: Folder for the results; it must exist.
        scale: Length of the image's unit [m], see `depth_in_metres`.

    Returns:
        The report, and a few lines for the terminal. `points` is 0 if nothing was measured.
    """
    depth = load_depth(path, intrinsics, scale=scale)
    unbounded = replace(CloudParameters(), floor_height=-np.inf, max_range=intrinsics.far)
    surface = observe_surfaces(depth, intrinsics, RigidTransform(), unbounded)
    measured = depth[depth > 0]
    share = measured.size / max(depth.size, 1)
    report = {
        "depth": str(path),
        "measured_share": share,
        "nearest": float(measured.min()) if measured.size else None,
        "median": float(np.median(measured)) if measured.size else None,
        "farthest": float(measured.max()) if measured.size else None,
        "points": len(surface.positions),
    }
    np.savez_compressed(folder / "cloud.npz", positions=surface.positions, normals=surface.normals)
    with offline_meshcat() as meshcat:
        meshcat.SetObject("cloud", to_point_cloud(surface), point_size=_POINT_SIZE)
        (folder / "cloud.html").write_text(meshcat.StaticHtml())
    _write(report, folder)
    line = f"  {100 * share:.0f} % measured, {report['points']} points"
    if measured.size:
        line += f", from {measured.min():.2f} to {measured.max():.2f} m"
    elif (out := _stored_range(read_depth(path))) is not None:
        line += (
            f": its values, {out[0]:g} to {out[1]:g}, are not {intrinsics.near:g} to"
            f" {intrinsics.far:g} m; say what length their unit is (--scale)"
        )
    return report, line


def _stored_range(stored: npt.NDArray[Any]) -> tuple[float, float] | None:
    """Returns least and largest value of a depth image that is no hole, None if all are holes."""
    values = stored[np.isfinite(stored) & (stored > 0)]
    if values.dtype.kind in "iu":
        values = values[~hole_codes(values)]
    return (float(values.min()), float(values.max())) if values.size else None


def report_cloud(path: Path, folder: Path, *, scale: float = 1.0) -> tuple[dict[str, Any], str]:
    """Reads a cloud; writes report.json and cloud.html.

    Args:
        path: The cloud, see `load_cloud`.
        folder: Folder for the results; it must exist.
        scale: Length of the file's unit [m].

    Returns:
        The report, and a few lines for the terminal.
    """
    points = load_cloud(path, scale=scale)
    low, high = points.min(axis=0), points.max(axis=0)
    report = {
        "cloud": str(path),
        "points": len(points),
        "lowest": low.tolist(),
        "highest": high.tolist(),
    }
    with offline_meshcat() as meshcat:
        meshcat.SetObject("cloud", make_cloud(points), point_size=_POINT_SIZE)
        (folder / "cloud.html").write_text(meshcat.StaticHtml())
    _write(report, folder)
    sides = " x ".join(f"{side:.2f}" for side in high - low)
    return report, f"  {len(points)} points in a box of {sides} m"


def _write(report: dict[str, Any], folder: Path) -> None:
    (folder / "report.json").write_text(json.dumps(report, indent=2) + "\n")
