"""Reads a camera's intrinsics from the files that calibration tools write.

Supported are ROS `camera_info` (the YAML of `camera_calibration` and a printed `CameraInfo`
message), OpenCV's FileStorage (YAML, JSON or XML, as its calibration samples write it), files with
separate focal lengths and principal point (Kalibr, EuRoC, RealSense, ORB-SLAM, VINS), and NAOqi's
names of camera and resolution with their fields of view.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.errors import InputError
from pepper_drake.files import LARGEST_NUMBER, read_text
from pepper_drake.perception.cameras.camera import (
    CAMERA_BOTTOM,
    CAMERA_DEPTH,
    CAMERA_TOP,
    CameraIntrinsics,
)
from pepper_drake.short_repr import short_repr
from pepper_drake.yaml_files import compose, construct

_MATRIX_NAMES = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "CameraMatrix", "K", "k", "mtx")
_DISTORTION_NAMES = (
    "distortion_coefficients",
    "Distortion_Coefficients",
    "distCoeffs",
    "dist_coeffs",
    "distortionCoefficients",
    "distortion_coeffs",
    "dist_coeff",
    "coeffs",
    "D",
    "d",
    "dist",
)
_WIDTH_NAMES = ("image_width", "image_Width", "imageWidth", "width", "Camera.width")
_HEIGHT_NAMES = ("image_height", "image_Height", "imageHeight", "height", "Camera.height")
_PARAMETER_NAMES = (
    ("fx", "Camera.fx", "Camera1.fx"),
    ("fy", "Camera.fy", "Camera1.fy"),
    ("cx", "ppx", "Camera.cx", "Camera1.cx"),
    ("cy", "ppy", "Camera.cy", "Camera1.cy"),
)
_SIZE_NAMES = ("image_size", "imageSize", "img_size", "size", "resolution")
_PINHOLE_MODELS = (
    "plumb_bob", "rational_polynomial", "brown_conrady", "brown conrady", "radtan",
    "radial-tangential", "none", "pinhole", "opencv", "",
)  # fmt: skip
_FISHEYE_MODELS = (
    "equidistant", "fisheye", "kannala_brandt", "kannala_brandt4", "kannalabrandt8", "kb4",
    "omnidir", "omni", "mei", "ds", "eucm", "fov",
)  # fmt: skip
_MODEL_NAMES = (
    "distortion_model", "camera_model", "camera_type", "Camera.type", "model", "model_type",
)  # fmt: skip

_OFF_CENTRE = 0.15
"""Largest offset of the principal point from the image's centre, as a fraction of its size."""

_SHORTEST_FOCAL = 0.1
"""Shortest focal length, as a fraction of the width: 157 degrees, as no pinhole has."""

_LARGEST = 2**20
"""Largest calibration file [bytes]."""

NAOQI_RESOLUTIONS = {
    "kQQQQVGA": (8, (40, 30)),
    "kQQQVGA": (7, (80, 60)),
    "kQQVGA": (0, (160, 120)),
    "kQVGA": (1, (320, 240)),
    "kVGA": (2, (640, 480)),
    "k4VGA": (3, (1280, 960)),
    "k16VGA": (4, (2560, 1920)),
}
"""NAOqi's resolutions: number and image size [pixels]."""
_NAOQI_CAMERAS = {0: CAMERA_TOP, 1: CAMERA_BOTTOM, 2: CAMERA_DEPTH}


def load_intrinsics(path: str | Path) -> CameraIntrinsics:
    """Reads the intrinsics of one camera.

    Args:
        path: A file of a supported format; see the module.

    Returns:
        The intrinsics, in OpenCV's pixel coordinates like all these formats.

    Raises:
        InputError: If the format is unsupported, an entry is missing, or the lens is a fisheye.
    """
    path = Path(path)
    return _intrinsics(_read(path), str(path))


def _read(path: Path) -> dict[str, Any]:
    """Reads a file's entries; matrices become arrays."""
    text = read_text(path, _LARGEST)
    if text.lstrip().startswith(("<?xml", "<opencv_storage")):
        storage = _read_xml_storage(text, path)
        return {name: _plain(value) for name, value in storage.items()}
    # An OpenCV FileStorage is YAML or JSON except for its first line and the tag of its matrices.
    # OpenCV's own parser is not used, as it crashes on damaged files.
    text, of_opencv = re.subn(r"^%YAML[: ]1\.[0-9]+", "", text.lstrip(), count=1)
    if of_opencv:  # It accepts `name:2` as an entry; YAML does not.
        text = re.sub(r"^([ \t]*[\w.]+):(?=[-+.\d\[\"])", r"\1: ", text, flags=re.MULTILINE)
    text = re.sub(r"\n---\s*\Z", "\n", text)  # The end of a message printed by ROS.
    if text.startswith("# oST"):
        raise InputError(f"{path}: is ROS's old INI file; give the YAML that is written beside it.")
    text = re.sub(r"!!(?:opencv-matrix|opencv-nd-matrix|map)", "", text)
    root = compose(text, str(path))
    content = None if root is None else construct(root, str(path))
    if not isinstance(content, dict):
        raise InputError(
            f"{path}: holds no camera; expected are camera_matrix, image_width, image_height and "
            "distortion_coefficients."
        )
    cameras = [name for name, value in content.items() if re.fullmatch(r"cam\d+", str(name))]
    if len(cameras) > 1:
        raise InputError(
            f"{path}: has {len(cameras)} cameras (Kalibr's); give a file with one of them, such as"
            f" {cameras[0]}."
        )
    if cameras and isinstance(content[cameras[0]], dict):
        content = content[cameras[0]]
    for name in ("projection_parameters", "distortion_parameters"):  # VINS and camodocal.
        if isinstance(content.get(name), dict):
            content = {**content, **content[name]}
    return {str(name): _plain(value) for name, value in content.items()}


def _plain(value: Any) -> Any:
    """Converts a matrix written as `rows`, `cols`, `data` to an array; leaves other values."""
    if isinstance(value, dict) and "data" in value:
        data = _numbers(value["data"])
        rows, columns = value.get("rows"), value.get("cols")
        if not isinstance(rows, int) or not isinstance(columns, int):
            return value["data"]
        if data is not None and data.size == rows * columns:
            return data.reshape(rows, columns)
        return value["data"]
    return value


def _read_xml_storage(text: str, path: Path) -> dict[str, Any]:
    """Reads OpenCV's XML: matrices become dictionaries, other entries strings."""
    refused = InputError(f"{path}: is no XML of a file storage of OpenCV.")
    if "<!" in text.replace("<!--", ""):  # Entity declarations may expand to gigabytes.
        raise refused
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError):
        raise refused from None
    entries: dict[str, Any] = {}
    for node in root:
        parts = {part.tag: (part.text or "").strip() for part in node}
        if "data" not in parts:
            entries[node.tag] = (node.text or "").strip()
            continue
        sizes = [parts.get(name, "") for name in ("rows", "cols")]
        whole = all(size.isascii() and size.isdigit() and len(size) < 7 for size in sizes)
        rows, columns = (int(size) for size in sizes) if whole else (None, None)
        entries[node.tag] = {"rows": rows, "cols": columns, "data": parts["data"]}
    return entries


def _numbers(value: Any) -> npt.NDArray[np.float64] | None:
    """Converts a list, matrix or string of numbers to a flat array; None if it is neither."""
    if isinstance(value, str):
        value = re.split(r"[\s,;]+", value.strip("[]() \t\n"))
    if isinstance(value, np.ndarray | Iterable) and not isinstance(value, Mapping):
        try:
            return np.array(value, dtype=float).ravel()
        except (TypeError, ValueError):
            return None
    return None


def _first(entries: Mapping[str, Any], names: Iterable[str]) -> tuple[str, Any] | None:
    for name in names:
        if name in entries and entries[name] is not None:
            return name, entries[name]
    return None


def _entry(entries: Mapping[str, Any], name: str) -> Any:
    """Returns an entry, None if missing; an array as a list, for use in boolean expressions."""
    value = entries.get(name)
    return value.tolist() if isinstance(value, np.ndarray) else value


def _intrinsics(entries: Mapping[str, Any], where: str) -> CameraIntrinsics:
    if "camera" in entries and "resolution" in entries:
        return _naoqi(entries, where)
    _refuse_other_lenses(entries, where)
    found = _first(entries, _MATRIX_NAMES) or _parameters(entries)
    if found is None:
        raise InputError(
            f"{where}: has no camera matrix; name it camera_matrix (OpenCV, ROS) or K."
        )
    name, value = found
    matrix = _numbers(value)
    if matrix is None or matrix.size != 9:
        raise InputError(f"{where}: {name} must be 9 numbers, the rows of a 3x3 camera matrix.")
    size = _image_size(entries, where)
    camera = make_intrinsics(matrix.reshape(3, 3), _distortion(entries, where), size, where=where)
    for axis, center, length in zip("xy", (camera.center_x, camera.center_y), size, strict=True):
        if abs(center + 0.5 - length / 2) > _OFF_CENTRE * length:
            raise InputError(
                f"{where}: the principal point is at {axis} = {center:g} of {length} pixels, far "
                "from the middle; is the matrix of images of another size?"
            )
    if camera.focal_x < _SHORTEST_FOCAL * size[0]:
        raise InputError(
            f"{where}: a focal length of {camera.focal_x:g} pixels would be a view of "
            f"{2 * math.degrees(math.atan(size[0] / 2 / camera.focal_x)):.0f} degrees; is it in "
            "millimetres? Divide it by the size of a pixel."
        )
    return camera


def _parameters(entries: Mapping[str, Any]) -> tuple[str, Any] | None:
    """Makes a camera matrix from separate entries for focal lengths and principal point."""
    listed = _numbers(entries.get("intrinsics", ()))
    if listed is not None and listed.size == 4:
        name, values = "intrinsics", list(listed)
    else:
        found = [_first(entries, names) for names in _PARAMETER_NAMES]
        name, values = "fx, fy, cx, cy", [entry[1] for entry in found if entry is not None]
    if len(values) != 4:
        return None
    fx, fy, cx, cy = values
    return name, [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0]


def make_intrinsics(
    matrix: npt.NDArray[np.float64],
    distortion: npt.ArrayLike,
    size: tuple[int, int],
    *,
    where: str = "camera",
) -> CameraIntrinsics:
    """Makes intrinsics from a camera matrix, as returned by OpenCV's calibration.

    Args:
        matrix: K (3, 3) [pixels].
        distortion: 0, 4, 5 or 8 coefficients in OpenCV's order, in any container.
        size: Width and height of the calibrated images [pixels].
        where: Prefix of error messages.
    """
    lower = np.array([matrix[1, 0], matrix[2, 0], matrix[2, 1], matrix[2, 2] - 1.0])
    if not np.all(np.isfinite(matrix)) or np.abs(lower).max() > 1e-9:
        raise InputError(
            f"{where}: the camera matrix must be [[fx, 0, cx], [0, fy, cy], [0, 0, 1]]."
        )
    if abs(matrix[0, 1]) > 1e-6 * abs(matrix[0, 0]):
        raise InputError(
            f"{where}: the camera matrix has a skew of {matrix[0, 1]:g}; it must be 0."
        )
    try:
        return CameraIntrinsics(
            *size,
            float(matrix[0, 0]),
            float(matrix[1, 1]),
            float(matrix[0, 2]),
            float(matrix[1, 2]),
            tuple(np.ravel(distortion)),
        )
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def _refuse_other_lenses(entries: Mapping[str, Any], where: str) -> None:
    """Raises InputError unless the images are pinhole images of the whole sensor."""
    for name in _MODEL_NAMES:
        model = str(_entry(entries, name) or "").strip().lower().removeprefix("distortion.")
        is_fisheye = bool(_entry(entries, "fisheye_model")) or "xi" in entries
        if is_fisheye or model in _FISHEYE_MODELS:
            raise InputError(
                f"{where}: is of a fisheye lens ({model or 'fisheye_model or xi'}); undistort its "
                "images and give the calibration of the undistorted ones."
            )
        if model in ("inverse_brown_conrady", "inverse brown conrady", "modified_brown_conrady"):
            coefficients = _numbers(entries.get("coeffs", ()))
            if coefficients is None or not np.any(coefficients):
                continue
        if model not in _PINHOLE_MODELS:
            raise InputError(
                f"{where}: distortion model {model!r} is unknown; plumb_bob and "
                "rational_polynomial are read."
            )
    for name in ("binning_x", "binning_y"):
        if _number(entries, name, where) > 1:
            raise InputError(
                f"{where}: {name} is {entries[name]}: calibrate the images as they are taken."
            )
    window = entries.get("roi")
    if isinstance(window, Mapping):
        offsets = [_number(window, name, where) for name in ("x_offset", "y_offset")]
        if any(offsets):
            raise InputError(
                f"{where}: its images are a part of the sensor's (roi); give whole ones."
            )


def _number(entries: Mapping[str, Any], name: str, where: str) -> float:
    """Returns an entry that must be one number; 0 if it is missing or empty."""
    value = _entry(entries, name) or 0.0
    numbers = _numbers(value if isinstance(value, str | list) else [value])
    if numbers is None or numbers.size != 1:
        raise InputError(f"{where}: {name} must be a number.")
    return float(numbers[0])


def _distortion(entries: Mapping[str, Any], where: str) -> npt.NDArray[np.float64]:
    found = _first(entries, _DISTORTION_NAMES)
    if found is None:
        words = [
            _first(entries, (name, f"Camera.{name}", f"Camera1.{name}"))
            for name in ("k1", "k2", "p1", "p2", "k3")
        ]
        if any(words):
            return np.array([0.0 if w is None else _number({"k": w[1]}, "k", where) for w in words])
        alike = difflib.get_close_matches("distortion_coefficients", map(str, entries), 1, 0.8)
        if alike:
            raise InputError(f"{where}: has {alike[0]}; name it distortion_coefficients.")
        if _first(entries, ("distortion_model",)) is None:
            raise InputError(
                f"{where}: has no distortion_coefficients; write an empty list if the lens has no "
                "distortion."
            )
        return np.zeros(0)
    name, value = found
    is_empty = isinstance(value, str | list) and not value
    numbers = np.zeros(0) if is_empty else _numbers(value)
    if numbers is None:
        raise InputError(f"{where}: {name} must be a list of numbers.")
    return numbers


def _image_size(entries: Mapping[str, Any], where: str) -> tuple[int, int]:
    width, height = _first(entries, _WIDTH_NAMES), _first(entries, _HEIGHT_NAMES)
    size = _first(entries, _SIZE_NAMES)
    if width is not None and height is not None:
        values = [width[1], height[1]]
    elif size is not None:
        numbers = _numbers(size[1])
        values = [] if numbers is None else numbers.tolist()
    else:
        raise InputError(f"{where}: has no image size; add image_width and image_height.")
    try:
        whole = [int(value) for value in values]
        if len(whole) != 2 or any(float(v) != w for v, w in zip(values, whole, strict=True)):
            raise ValueError
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(
            f"{where}: image size {values} must be two whole numbers of pixels."
        ) from error
    return whole[0], whole[1]


def _naoqi(entries: Mapping[str, Any], where: str) -> CameraIntrinsics:
    """Makes a camera from NAOqi's names or numbers of camera and resolution.

    `horizontal_fov` and `vertical_fov` [rad], as given by ALVideoDevice, default to the camera's.
    """
    camera = entries["camera"]
    by_name = {head.name: head for head in _NAOQI_CAMERAS.values()}
    head = _NAOQI_CAMERAS.get(camera) if isinstance(camera, int) else by_name.get(str(camera))
    if head is None:
        raise InputError(
            f"{where}: camera {camera!r} is unknown; NAOqi's are 0 or CameraTop, 1 or CameraBottom "
            "and 2 or CameraDepth."
        )
    resolution = entries["resolution"]
    by_number = dict(NAOQI_RESOLUTIONS.values())
    if isinstance(resolution, int):
        size = by_number.get(resolution)
    else:
        size = NAOQI_RESOLUTIONS.get(str(resolution), (0, None))[1]
    if size is None:
        raise InputError(
            f"{where}: resolution {resolution!r} is unknown; NAOqi's are names like kVGA, or their "
            "numbers."
        )
    width, height = size
    own = head.intrinsics
    focal = [own.focal_x * width / own.width, own.focal_y * height / own.height]
    for k, (name, pixels) in enumerate((("horizontal_fov", width), ("vertical_fov", height))):
        if entries.get(name) is not None:
            try:
                angle = float(entries[name])
            except (TypeError, ValueError):
                angle = math.nan
            if not 0.0 < angle < math.pi:
                raise InputError(f"{where}: {name} {entries[name]!r} must be an angle [rad].")
            focal[k] = pixels / 2 / math.tan(angle / 2)
    return replace(
        own,
        width=width,
        height=height,
        focal_x=focal[0],
        focal_y=focal[1],
        center_x=(width - 1) / 2,
        center_y=(height - 1) / 2,
    )


@dataclass(frozen=True)
class StereoCalibration:
    """A calibrated stereo pair, with any rotation between the cameras.

    Attributes:
        left: Intrinsics of the left camera.
        right: Intrinsics of the right camera.
        X_RL: Pose of the left optical frame in the right one, [m].
    """

    left: CameraIntrinsics
    right: CameraIntrinsics
    X_RL: RigidTransform

    __repr__ = short_repr

    def __post_init__(self) -> None:
        if (self.left.width, self.left.height) != (self.right.width, self.right.height):
            raise InputError(
                f"stereo calibration: the left image is {self.left.width}x{self.left.height} and "
                f"the right one {self.right.width}x{self.right.height}; they must be equal."
            )
        p_RL = self.X_RL.translation()
        if not p_RL[0] < 0 or abs(p_RL[0]) < 2.0 * float(np.hypot(p_RL[1], p_RL[2])):
            raise InputError(
                f"stereo calibration: the left camera is at {np.round(p_RL, 4).tolist()} m in the "
                "right camera's frame; it must be to its left (x negative). Are left and right "
                "exchanged, or is the unit not metres?"
            )


def load_stereo(path: str | Path, *, unit: float = 1.0) -> StereoCalibration:
    """Reads a calibration as written by OpenCV's `stereo_calib` sample.

    Args:
        path: A FileStorage with `M1`, `D1`, `M2`, `D2`, `R`, `T` (p_R = R p_L + T) and
            `image_width`, `image_height` or `image_size`.
        unit: Unit of T [m]: that of the chessboard's squares in the calibration.
    """
    path = Path(path)
    entries, where = _read(path), str(path)
    _refuse_other_lenses(entries, where)
    size = _image_size(entries, where)

    def numbers(name: str, *others: str, count: int) -> npt.NDArray[np.float64]:
        found = _first(entries, (name, *others))
        values = None if found is None else _numbers(found[1])
        if values is None or (count and values.size != count):
            wanted = f"{count} numbers" if count else "a list of numbers"
            raise InputError(f"{where}: {name} must be there as {wanted}.")
        if not np.all(np.abs(values) <= LARGEST_NUMBER):
            raise InputError(f"{where}: {name} holds what is no finite number, or too large a one.")
        return values

    cameras = []
    for k in (1, 2):
        matrix = numbers(f"M{k}", f"cameraMatrix{k}", f"K{k}", count=9).reshape(3, 3)
        distortion = numbers(f"D{k}", f"distCoeffs{k}", count=0)
        cameras.append(make_intrinsics(matrix, distortion, size, where=f"{where}: camera {k}"))
    R = numbers("R", count=9).reshape(3, 3)
    if np.abs(R @ R.T - np.eye(3)).max() > 1e-4 or np.linalg.det(R) < 0:
        raise InputError(f"{where}: R must be a rotation matrix.")
    T = numbers("T", count=3)
    X_RL = RigidTransform(RotationMatrix.ProjectToRotationMatrix(R), unit * T)
    try:
        return StereoCalibration(cameras[0], cameras[1], X_RL)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error
