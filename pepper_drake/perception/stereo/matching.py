"""Depth from a stereo pair behind Pepper's eyes.

The report computed x = ((u - cx) z + b) / f for both cameras and found its cloud shifted along x.
The baseline b affects the disparity alone: in the left camera's frame x = (u - cx) z / f; in the
right camera's frame the coordinate differs by b (equations 3.3 and 3.5).
"""

import functools
import math
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import CameraIntrinsics, HeadCamera
from pepper_drake.perception.mapping.cloud import CloudParameters
from pepper_drake.perception.mapping.depth_validity import ValidityParameters
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters
from pepper_drake.perception.mapping.voxel_map import VoxelMapParameters

Array = npt.NDArray[np.float32]

STEREO_BASELINE = 0.078
"""Distance of the two cameras [m]. An assumption without a source, as the left eye is 0.039 m off
the centre."""

_EYE = (0.05138, 0.1194)
"""Position of the eyes in the Head frame along x and z [m], that of other robots' depth camera."""


def make_stereo_cameras(
    baseline: float = STEREO_BASELINE,
    *,
    distortion: tuple[float, float, float, float, float] = (-0.04, 0.03, 0.0, 0.0, 0.0),
) -> tuple[HeadCamera, HeadCamera]:
    """Returns the left and the right camera: 1280x720, vertical field of view 60 degrees.

    Args:
        baseline: Distance of the two [m].
        distortion: Distortion of both lenses.
    """
    if not baseline > 0:
        raise InputError(f"stereo baseline {baseline} must be positive.")
    intrinsics = CameraIntrinsics.from_vertical_fov(
        1280, 720, math.radians(60), distortion=distortion, near=0.05, far=10.0
    )
    x, z = _EYE
    return (
        HeadCamera("CameraStereoLeft", intrinsics, (x, baseline / 2, z), 0.0),
        HeadCamera("CameraStereoRight", intrinsics, (x, -baseline / 2, z), 0.0),
    )


@dataclass(frozen=True)
class Rectification:
    """Rectification of two images to aligned rows, and the left camera after it.

    Attributes:
        left_maps: Maps for `cv2.remap` of the left image.
        right_maps: Maps for `cv2.remap` of the right image.
        intrinsics: Intrinsics of the rectified left camera, without distortion.
        baseline: Distance of the cameras [m].
        offset: Disparity of a point at infinity [pixels]: the difference of the two principal
            points.
        R_CLeftRect: Orientation of the rectified left camera in the left one.
    """

    left_maps: tuple[npt.NDArray[np.int16], npt.NDArray[np.uint16]]
    right_maps: tuple[npt.NDArray[np.int16], npt.NDArray[np.uint16]]
    intrinsics: CameraIntrinsics
    baseline: float
    offset: float
    R_CLeftRect: RotationMatrix

    def rectified_pose(self, X_WLeft: RigidTransform) -> RigidTransform:
        """Returns the pose of the rectified left camera, given that of the left one."""
        return X_WLeft @ RigidTransform(self.R_CLeftRect, np.zeros(3))


@dataclass(unsafe_hash=True)
class StereoParameters:
    """Parameters of semi-global matching (Hirschmueller 2008, doi:10.1109/TPAMI.2007.1166).

    Attributes:
        nearest: Smallest depth that can be matched [m]: it determines the range of disparities.
        farthest: Largest depth that is kept [m].
        block: Edge of the compared blocks, odd [pixels].
        uniqueness: Margin by which the best match must beat the second [percent].
        speckle_size: Regions of fewer pixels are dropped as mismatches.
        left_right: Largest disagreement of the matches from left and right [pixels].
        min_texture: Smallest standard deviation of grey levels in a block that can be matched.
        body_margin: Margin by which the robot's shapes are enlarged to mask the image [m].
        exchanged: Left and right count as exchanged if, the other way round, more than this many
            times as many pixels match, ...
        few_matches: ... plus this fraction of all pixels. Checked only for images of which a
            smaller fraction matches.
    """

    nearest: float = 0.35
    farthest: float = 1.5
    block: int = 7
    uniqueness: int = 15
    speckle_size: int = 300
    left_right: int = 1
    min_texture: float = 2.5
    body_margin: float = 0.01
    exchanged: float = 3.0
    few_matches: float = 0.02

    def __post_init__(self) -> None:
        self.check()

    def check(self) -> None:
        """Raises InputError for distances out of order, or an even block size."""
        if not 0 < self.nearest < self.farthest:
            raise InputError(
                f"stereo: nearest {self.nearest} must be positive and less than farthest "
                f"{self.farthest}."
            )
        if self.block < 1 or self.block % 2 == 0:
            raise InputError(f"stereo: block {self.block} must be odd.")


def stereo_obstacle_parameters() -> ObstacleParameters:
    """Returns obstacle parameters for stereo images: more pixels, each less certain."""
    return ObstacleParameters(
        cloud=CloudParameters(stride=4, flying_noise=0.004, object_margin=0.02, robot_margin=0.03),
        memory=VoxelMapParameters(depth_noise=0.005),
        validity=ValidityParameters(shows_all=False),
        treat_holes_as_near=False,
    )


def rectify(left: HeadCamera, right: HeadCamera) -> Rectification:
    """Computes the rectification of two cameras fixed to each other on the head.

    Args:
        left: The left camera.
        right: The right camera, of the same image size.
    """
    return rectify_pair(left.intrinsics, right.intrinsics, right.X_HeadC.inverse() @ left.X_HeadC)


def rectify_pair(
    left: CameraIntrinsics, right: CameraIntrinsics, X_RL: RigidTransform
) -> Rectification:
    """Computes the rectification of two cameras with any rotation between them.

    Args:
        left: Intrinsics of the left camera.
        right: Intrinsics of the right camera, of the same image size.
        X_RL: Pose of the left optical frame in the right one, as a stereo calibration gives it
            (see `cameras.camera_files.load_stereo`).

    Raises:
        InputError: If the images differ in size, or left and right are exchanged.
    """
    p_RL = X_RL.translation()
    return _rectify(left, right, X_RL.rotation().matrix().tobytes(), tuple(map(float, p_RL)))


@functools.lru_cache(maxsize=4)
def _rectify(
    left: CameraIntrinsics, right: CameraIntrinsics, R_RL: bytes, p_RL: tuple[float, ...]
) -> Rectification:
    size = (left.width, left.height)
    if size != (right.width, right.height):
        raise InputError("stereo: both images must have the same size.")
    if not p_RL[0] < 0:
        raise InputError(
            "stereo: the left camera is to the right of the right one; exchange left and right."
        )
    R_left, R_right, P_left, P_right = cv2.stereoRectify(
        left.matrix,
        left.distortion_coefficients,
        right.matrix,
        right.distortion_coefficients,
        size,
        np.frombuffer(R_RL).reshape(3, 3),
        np.array(p_RL).reshape(3, 1),
        flags=cv2.CALIB_ZERO_DISPARITY,
        alpha=0,
    )[:4]
    maps = [
        cv2.initUndistortRectifyMap(
            camera.matrix,
            camera.distortion_coefficients,
            R,
            P[:, :3],
            size,
            cv2.CV_16SC2,
        )
        for camera, R, P in ((left, R_left, P_left), (right, R_right, P_right))
    ]
    intrinsics = CameraIntrinsics(
        *size,
        float(P_left[0, 0]),
        float(P_left[1, 1]),
        float(P_left[0, 2]),
        float(P_left[1, 2]),
        near=left.near,
        far=left.far,
    )
    return Rectification(
        maps[0],
        maps[1],
        intrinsics,
        float(-P_right[0, 3] / P_right[0, 0]),
        float(P_left[0, 2] - P_right[0, 2]),
        RotationMatrix(R_left).inverse(),
    )


def rectify_images(
    left: npt.NDArray[np.uint8], right: npt.NDArray[np.uint8], rectification: Rectification
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Undistorts and aligns two images of any number of channels.

    Raises:
        InputError: If they have another size than the calibrated cameras.
    """
    camera = rectification.intrinsics
    for name, image in (("left", left), ("right", right)):
        if image.shape[:2] != (camera.height, camera.width):
            raise InputError(
                f"stereo: the {name} image is {image.shape[1]}x{image.shape[0]}, but the cameras' "
                f"calibration is of {camera.width}x{camera.height}."
            )
    return (
        cv2.remap(left, *rectification.left_maps, cv2.INTER_LINEAR),
        cv2.remap(right, *rectification.right_maps, cv2.INTER_LINEAR),
    )


def are_exchanged(
    left: npt.NDArray[np.uint8],
    right: npt.NDArray[np.uint8],
    rectification: Rectification,
    parameters: StereoParameters,
) -> bool:
    """Tells whether two rectified images match only the other way round.

    Args:
        left: Rectified grey image (height, width).
        right: Rectified grey image (height, width).
        rectification: Their rectification.
        parameters: Parameters of the matching.
    """
    matched = np.mean(match(left, right, rectification, parameters) > 0)
    other_way = np.mean(match(right, left, rectification, parameters) > 0)
    return bool(other_way > parameters.exchanged * matched + parameters.few_matches)


def match(
    left: npt.NDArray[np.uint8],
    right: npt.NDArray[np.uint8],
    rectification: Rectification,
    parameters: StereoParameters,
) -> Array:
    """Finds the disparity of the left image's pixels.

    Args:
        left: Rectified grey image (height, width).
        right: Rectified grey image (height, width).
        rectification: Their rectification.
        parameters: Parameters of the matching.

    Returns:
        Disparities (height, width) [pixels]; 0 where none was found, where the image has too little
        texture, and outside the nearest and farthest depth.
    """
    reach = rectification.intrinsics.focal_x * rectification.baseline
    largest = reach / parameters.nearest + rectification.offset
    smallest = reach / parameters.farthest + rectification.offset
    matcher = cv2.StereoSGBM_create(
        minDisparity=0,
        numDisparities=16 * math.ceil(largest / 16),
        blockSize=parameters.block,
        P1=8 * parameters.block**2,
        P2=32 * parameters.block**2,
        disp12MaxDiff=parameters.left_right,
        preFilterCap=31,
        uniquenessRatio=parameters.uniqueness,
        speckleWindowSize=parameters.speckle_size,
        speckleRange=2,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    disparity = matcher.compute(left, right).astype(np.float32) / 16
    window = (parameters.block + 4,) * 2
    mean = cv2.boxFilter(left, cv2.CV_32F, window)
    variance = cv2.sqrBoxFilter(left, cv2.CV_32F, window) - np.square(mean)
    is_reliable = (variance >= parameters.min_texture**2) & (disparity >= smallest)
    found = np.where(is_reliable & (disparity <= largest), disparity, np.float32(0))
    return refine_disparity(left, right, found, parameters)


def refine_disparity(
    left: npt.NDArray[np.uint8],
    right: npt.NDArray[np.uint8],
    disparity: Array,
    parameters: StereoParameters,
) -> Array:
    """Refines disparities from an error of about a quarter of a pixel to a few hundredths.

    The parabola that semi-global matching fits to its costs is biased towards whole pixels: for a
    wall 0.9 m away, by 4 mm of depth. Two Gauss-Newton steps on the brightness itself (Lucas and
    Kanade 1981) are not.

    Args:
        left: Rectified grey image (height, width).
        right: Rectified grey image (height, width).
        disparity: Disparities (height, width) [pixels], 0 where there is none.
        parameters: Parameters of the matching.

    Returns:
        Disparities; 0 also where the refined one is far from the given one.
    """
    window = (parameters.block + 6,) * 2
    smooth_left = cv2.GaussianBlur(left, (0, 0), 0.8).astype(np.float32)
    smooth_right = cv2.GaussianBlur(right, (0, 0), 0.8).astype(np.float32)
    rows, columns = np.indices(disparity.shape, dtype=np.float32)
    refined = disparity.copy()
    for _ in range(2):
        warped = cv2.remap(smooth_right, columns - refined, rows, cv2.INTER_LINEAR)
        slope = cv2.Sobel(warped, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8)
        error = smooth_left - warped
        # Covariances over the window, so that a difference in exposure does not count.
        mean_slope = cv2.boxFilter(slope, -1, window)
        joint = cv2.boxFilter(slope * error, -1, window)
        joint -= mean_slope * cv2.boxFilter(error, -1, window)
        spread = cv2.boxFilter(slope * slope, -1, window) - np.square(mean_slope)
        refined -= np.clip(joint / np.maximum(spread, 1e-3), -0.5, 0.5)
    # At object edges the window contains two depths and the refinement diverges.
    kept = (disparity > 0) & (np.abs(refined - disparity) < 0.6)
    return np.where(kept, refined, np.float32(0))


def disparity_to_depth(disparity: Array, rectification: Rectification) -> Array:
    """Computes z = f b / disparity (equation 3.3); 0 where there is no disparity.

    Args:
        disparity: (height, width) [pixels], 0 where there is none.
        rectification: Rectification of the cameras.

    Returns:
        Depth image of the rectified left camera (height, width) [m].
    """
    reach = rectification.intrinsics.focal_x * rectification.baseline
    shifted = disparity - np.float32(rectification.offset)
    depth = np.zeros_like(disparity)
    np.divide(np.float32(reach), shifted, out=depth, where=(disparity > 0) & (shifted > 0))
    return depth
