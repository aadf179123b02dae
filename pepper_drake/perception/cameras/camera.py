"""Camera models: intrinsics with distortion, extrinsics on the head, rendering.

Pixel coordinates are OpenCV's throughout: integer `k` is the centre of pixel `k`. Drake's renderer
has that centre at `k + 0.5`, so its principal point is half a pixel larger; `make_render_cameras`
converts.
"""

import functools
import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    RenderCameraCore,
)
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.sensors import CameraInfo

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.projection import project_points

_CLOSEST = 0.05
"""Smallest rendered depth [m]."""

_LARGEST_IMAGE = 20_000
"""Largest width and height of an image [pixels]: more than any camera's."""

_LARGEST_DISTORTION = 1e4
"""Largest distortion coefficient; those of the rational model may be tens."""

_LARGEST_FOCAL = 1e6
"""Largest focal length [pixels]: that of a telescope."""


@dataclass(frozen=True)
class CameraIntrinsics:
    """A pinhole camera with OpenCV's distortion model.

    The model is that of Brown and Conrady, or with eight coefficients the rational model.

    Attributes:
        width: Image width [pixels].
        height: Image height [pixels].
        focal_x: Focal length along image x [pixels].
        focal_y: Focal length along image y [pixels].
        center_x: Principal point [pixels]; `(width - 1) / 2` is the image's centre.
        center_y: Principal point [pixels].
        distortion: `(k1, k2, p1, p2[, k3[, k4, k5, k6]])`, as in OpenCV, in any container; empty
            for no distortion. Stored as 5 or 8 numbers.
        near: Smallest depth that it measures or renders [m].
        far: Largest depth that it measures or renders [m].
    """

    width: int
    height: int
    focal_x: float
    focal_y: float
    center_x: float
    center_y: float
    distortion: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    near: float = 0.05
    far: float = 10.0

    def __repr__(self) -> str:
        """Returns a short text, as cameras are default arguments in signatures."""
        return f"CameraIntrinsics({self.width} x {self.height}, focal length {self.focal_x:.1f})"

    def __post_init__(self) -> None:
        # A tuple is hashable.
        object.__setattr__(self, "distortion", _checked_distortion(self.distortion))
        if self.width <= 0 or self.height <= 0:
            raise InputError(f"camera: image size {self.width}x{self.height} must be positive.")
        if max(self.width, self.height) > _LARGEST_IMAGE:
            raise InputError(
                f"camera: image size {self.width:g}x{self.height:g}; no side may have more than "
                f"{_LARGEST_IMAGE} pixels."
            )
        if not (0 < self.focal_x <= _LARGEST_FOCAL and 0 < self.focal_y <= _LARGEST_FOCAL):
            raise InputError(
                f"camera: focal lengths ({self.focal_x:g}, {self.focal_y:g}) must be positive and "
                f"at most {_LARGEST_FOCAL:g} pixels."
            )
        if not max(abs(self.center_x), abs(self.center_y)) <= _LARGEST_FOCAL:
            raise InputError(
                f"camera: centre ({self.center_x:g}, {self.center_y:g}) must be pixels."
            )
        if not 0 < self.near < self.far:
            raise InputError(
                f"camera: near {self.near} must be positive and less than far {self.far}."
            )

    @classmethod
    def from_vertical_fov(
        cls,
        width: int,
        height: int,
        fov_y: float,
        *,
        distortion: tuple[float, ...] = (),
        near: float = 0.05,
        far: float = 10.0,
    ) -> "CameraIntrinsics":
        """Makes a camera with square pixels and centred principal point from its field of view.

        Args:
            width: Image width [pixels].
            height: Image height [pixels].
            fov_y: Vertical field of view [rad].
            distortion: See the class.
            near: Nearest depth [m].
            far: Farthest depth [m].
        """
        if not 0 < fov_y < math.pi:
            raise InputError(f"camera: vertical field of view {fov_y} must be within (0, pi).")
        focal = height / 2 / math.tan(fov_y / 2)
        return cls(
            width,
            height,
            focal,
            focal,
            (width - 1) / 2,
            (height - 1) / 2,
            distortion,
            near,
            far,
        )

    @property
    def matrix(self) -> npt.NDArray[np.float64]:
        """Returns the camera matrix K (3, 3)."""
        return np.array(
            [
                [self.focal_x, 0.0, self.center_x],
                [0.0, self.focal_y, self.center_y],
                [0.0, 0.0, 1.0],
            ]
        )

    @property
    def distortion_coefficients(self) -> npt.NDArray[np.float64]:
        """Returns the distortion as OpenCV takes it, (5,) or (8,)."""
        return np.array(self.distortion)

    @property
    def is_distorted(self) -> bool:
        """Tells whether any distortion coefficient is non-zero."""
        return any(self.distortion)

    @functools.cached_property
    def numbers(self) -> npt.NDArray[np.float64]:
        """Returns focal lengths, principal point and eight distortion coefficients (12,)."""
        pinhole = (self.focal_x, self.focal_y, self.center_x, self.center_y)
        return np.array((*pinhole, *self.distortion, 0.0, 0.0, 0.0)[:12])

    def ideal(self) -> "CameraIntrinsics":
        """Returns the same camera without its distortion."""
        return CameraIntrinsics(
            self.width,
            self.height,
            self.focal_x,
            self.focal_y,
            self.center_x,
            self.center_y,
            near=self.near,
            far=self.far,
        )

    def scaled(self, factor: int) -> "CameraIntrinsics":
        """Returns a camera of the same field of view with `factor` times the pixels per axis."""
        return CameraIntrinsics(
            self.width * factor,
            self.height * factor,
            self.focal_x * factor,
            self.focal_y * factor,
            (self.center_x + 0.5) * factor - 0.5,
            (self.center_y + 0.5) * factor - 0.5,
            self.distortion,
            self.near,
            self.far,
        )

    def resized(self, width: int, height: int) -> "CameraIntrinsics":
        """Returns the camera of images that were resized without cropping.

        Args:
            width: Width of the resized images [pixels].
            height: Height of the resized images [pixels].

        Raises:
            InputError: If that changes the aspect ratio by more than half a pixel, as cropping
                does.
        """
        x, y = width / self.width, height / self.height
        if not (x > 0 and y > 0) or abs(x - y) > 0.5 * max(x / height, y / width):
            raise InputError(
                f"camera: {self.width}x{self.height} cannot be resized to {width}x{height}; the "
                "ratio of the sides must stay."
            )
        return replace(
            self,
            width=width,
            height=height,
            focal_x=self.focal_x * x,
            focal_y=self.focal_y * y,
            # The centre of the first pixel is at 0.
            center_x=(self.center_x + 0.5) * x - 0.5,
            center_y=(self.center_y + 0.5) * y - 0.5,
        )

    def project(self, p_CP: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Projects points into the image.

        Args:
            p_CP: Points in the camera frame, (..., 3) [m].

        Returns:
            Pixel coordinates (..., 2); NaN for points at or behind the camera.
        """
        p = np.asarray(p_CP, dtype=float)
        pixels = project_points(np.ascontiguousarray(p.reshape(-1, 3)), self.numbers)
        return np.asarray(pixels.reshape(*p.shape[:-1], 2))

    def sees(self, p_CP: npt.ArrayLike, margin: float = 0.0) -> npt.NDArray[np.bool_]:
        """Tells which points are in the field of view, at least `margin` pixels from its border.

        Args:
            p_CP: Points in the camera frame, (..., 3) [m].
            margin: Distance from the border [pixels].
        """
        uv = self.project(p_CP)
        last = np.array([self.width, self.height]) - 0.5 - margin
        with np.errstate(invalid="ignore"):
            return np.all((uv >= margin - 0.5) & (uv <= last), axis=-1)


def _checked_distortion(distortion: npt.ArrayLike) -> tuple[float, ...]:
    """Converts OpenCV's distortion coefficients of any allowed number to 5 or 8 numbers."""
    try:
        numbers = np.asarray(distortion, dtype=float).ravel()
    except (TypeError, ValueError) as error:
        raise InputError("camera: distortion must be a list of numbers.") from error
    if len(numbers) not in (0, 4, 5, 8, 12, 14) or not np.all(np.isfinite(numbers)):
        raise InputError(
            f"camera: {len(numbers)} distortion coefficients; give none, or 4, 5 or 8 numbers "
            "(k1, k2, p1, p2, k3, k4, k5, k6)."
        )
    if np.any(np.abs(numbers) > _LARGEST_DISTORTION):
        raise InputError(f"camera: a distortion coefficient is above {_LARGEST_DISTORTION:g}.")
    if np.any(numbers[8:]):
        raise InputError(
            "camera: the distortion of a thin prism or a tilted sensor (coefficients 9 to 14) is "
            "not modelled; calibrate with 4, 5 or 8 coefficients."
        )
    count = 8 if np.any(numbers[5:]) else 5
    padded = np.zeros(8)
    padded[: min(len(numbers), 8)] = numbers[:8]
    return tuple(float(number) for number in padded[:count])


@functools.lru_cache(maxsize=32)
def pixel_rays(intrinsics: CameraIntrinsics, stride: int = 1) -> npt.NDArray[np.float32]:
    """Returns the ray of every `stride`-th pixel, scaled to unit depth.

    A pixel of depth z shows the point `z * ray` in the camera frame. The first pixel used is
    `stride // 2`, so that the pixels used are distributed evenly.

    Args:
        intrinsics: The camera; its distortion is undone.
        stride: Step between pixels along both axes.

    Returns:
        Read-only array (rows, columns, 3).
    """
    if stride < 1:
        raise InputError(f"pixel_rays: stride {stride} must be at least 1.")
    start = stride // 2
    u, v = np.meshgrid(
        np.arange(start, intrinsics.width, stride, dtype=float),
        np.arange(start, intrinsics.height, stride, dtype=float),
    )
    pixels = np.stack([u.ravel(), v.ravel()], axis=-1)[:, None]
    if intrinsics.is_distorted:
        xy = cv2.undistortPoints(pixels, intrinsics.matrix, intrinsics.distortion_coefficients)[
            :, 0
        ]
    else:
        center = np.array([intrinsics.center_x, intrinsics.center_y])
        xy = (pixels[:, 0] - center) / np.array([intrinsics.focal_x, intrinsics.focal_y])
    rays = np.column_stack([xy, np.ones(len(xy))]).reshape(*u.shape, 3).astype(np.float32)
    rays.setflags(write=False)
    return rays


@functools.lru_cache(maxsize=32)
def ray_lengths(intrinsics: CameraIntrinsics, stride: int = 1) -> npt.NDArray[np.float32]:
    """Returns the lengths (rows, columns) of `pixel_rays`: distance of a point at unit depth."""
    lengths = np.linalg.norm(pixel_rays(intrinsics, stride), axis=-1)
    lengths.setflags(write=False)
    return lengths


@functools.lru_cache(maxsize=8)
def distortion_maps(
    intrinsics: CameraIntrinsics,
) -> tuple[npt.NDArray[np.int16], npt.NDArray[np.uint16]]:
    """Returns the maps with which `cv2.remap` distorts an ideal image."""
    xy = pixel_rays(intrinsics)[..., :2].astype(float)
    center = np.array([intrinsics.center_x, intrinsics.center_y])
    source = xy * np.array([intrinsics.focal_x, intrinsics.focal_y]) + center
    coarse, fine = cv2.convertMaps(source.astype(np.float32), None, cv2.CV_16SC2)
    return coarse, fine


def make_render_cameras(
    intrinsics: CameraIntrinsics, renderer_name: str
) -> tuple[ColorRenderCamera, DepthRenderCamera]:
    """Makes Drake's render cameras for these intrinsics, without distortion.

    Args:
        intrinsics: The camera; near and far become the depth range.
        renderer_name: Name of the render engine in the scene graph.
    """
    info = CameraInfo(
        intrinsics.width,
        intrinsics.height,
        intrinsics.focal_x,
        intrinsics.focal_y,
        intrinsics.center_x + 0.5,
        intrinsics.center_y + 0.5,
    )
    # The clipping plane is nearer than the depth range: an object too near to be measured still
    # occludes.
    clipping = ClippingRange(min(0.01, intrinsics.near), intrinsics.far + 2.0)
    core = RenderCameraCore(renderer_name, info, clipping, RigidTransform())
    return (
        ColorRenderCamera(core),
        # An object too near to be measured still blocks the projector's light.
        DepthRenderCamera(core, DepthRange(min(_CLOSEST, intrinsics.near), intrinsics.far)),
    )


@dataclass(frozen=True)
class HeadCamera:
    """One of Pepper's cameras: intrinsics, and extrinsics on the link `Head`.

    Attributes:
        name: NAOqi's name; the optical frame is `<name>_optical_frame`.
        intrinsics: The intrinsics.
        p_HeadC: Position of the optical centre in the Head frame [m].
        tilt: Downward tilt of the optical axis from the Head's x axis [rad].
        misalignment: Small rotation of the optical frame, roll, pitch and yaw in it [rad].
    """

    name: str
    intrinsics: CameraIntrinsics
    p_HeadC: tuple[float, float, float]
    tilt: float
    misalignment: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __repr__(self) -> str:
        """Returns a short text, as cameras are default arguments in signatures."""
        return f"HeadCamera({self.name})"

    @property
    def frame_name(self) -> str:
        """Returns the name of the optical frame in Pepper's model."""
        return f"{self.name}_optical_frame"

    @functools.cached_property
    def X_HeadC(self) -> RigidTransform:
        """Returns the pose of the optical frame (z forward, x right, y down) in the Head frame."""
        X_HeadC = RigidTransform(RollPitchYaw(0, self.tilt, 0), self.p_HeadC) @ RigidTransform(
            RollPitchYaw(-math.pi / 2, 0, -math.pi / 2), np.zeros(3)
        )
        if not any(self.misalignment):
            return X_HeadC
        return X_HeadC @ RigidTransform(RollPitchYaw(self.misalignment), np.zeros(3))


def moved_camera(
    camera: HeadCamera,
    position: tuple[float, float, float],
    rotation: tuple[float, float, float],
    focal: float,
) -> HeadCamera:
    """Returns a camera with slightly different extrinsics and focal length.

    Args:
        camera: The nominal camera.
        position: Offset of the optical centre in the Head frame [m].
        rotation: Rotation of the optical frame, roll, pitch and yaw in it [rad].
        focal: Factor of both focal lengths.
    """
    x, y, z = camera.p_HeadC
    return replace(
        camera,
        intrinsics=replace(
            camera.intrinsics,
            focal_x=focal * camera.intrinsics.focal_x,
            focal_y=focal * camera.intrinsics.focal_y,
        ),
        p_HeadC=(x + position[0], y + position[1], z + position[2]),
        misalignment=rotation,
    )


# Distortion from calibrations of real Peppers, published with their driver; fields of view and
# positions from the vendor's documentation.
CAMERA_TOP = HeadCamera(
    "CameraTop",
    CameraIntrinsics.from_vertical_fov(640, 480, 0.7627, distortion=(-0.05, 0.06, 0.0, 0.0, 0.0)),
    p_HeadC=(0.08601, 0.0, 0.16284),
    tilt=0.0,
)
CAMERA_BOTTOM = HeadCamera(
    "CameraBottom",
    CameraIntrinsics.from_vertical_fov(640, 480, 0.7627, distortion=(-0.065, 0.07, 0.0, 0.0, 0.0)),
    p_HeadC=(0.09262, 0.0, 0.06177),
    tilt=0.698132,
)
CAMERA_DEPTH = HeadCamera(
    "CameraDepth",
    CameraIntrinsics.from_vertical_fov(320, 240, math.pi / 4, near=0.4, far=8.0),
    p_HeadC=(0.05138, 0.039, 0.1194),
    tilt=0.0,
)
