"""Stereo pipeline: matching, segmentation, masking of the robot's own body."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.images import to_gray
from pepper_drake.perception.mapping.solids import Solid
from pepper_drake.perception.stereo.matching import (
    Rectification,
    StereoParameters,
    are_exchanged,
    disparity_to_depth,
    match,
    rectify_images,
)
from pepper_drake.perception.stereo.segmentation import (
    SegmentationParameters,
    body_mask,
    segment_disparity,
)


@dataclass(frozen=True)
class StereoResult:
    """Result for a stereo pair of images; all (height, width[, 3]) of the rectified left camera.

    Attributes:
        depth: [m]; 0 where nothing was matched, outside all segments and on the robot.
        disparity: [pixels]; 0 where nothing was matched.
        things: Segment labels 1, 2, ...; 0 outside all segments.
        body: Mask of the robot's own body with a margin.
        image: The rectified left image.
    """

    depth: npt.NDArray[np.float32]
    disparity: npt.NDArray[np.float32]
    things: npt.NDArray[np.int32]
    body: npt.NDArray[np.bool_]
    image: npt.NDArray[np.uint8]


def compute_stereo_depth(
    left: npt.NDArray[np.uint8],
    right: npt.NDArray[np.uint8],
    rectification: Rectification,
    X_WC: RigidTransform,
    solids: Sequence[Solid],
    poses: Sequence[RigidTransform],
    parameters: StereoParameters,
    segmentation: SegmentationParameters,
) -> StereoResult:
    """Computes a depth image of segmented objects from a pair of raw images.

    Args:
        left: The left camera's image (height, width[, 3 or 4]), in colour or grey.
        right: The right camera's image.
        rectification: Rectification of the two.
        X_WC: Pose of the rectified left camera.
        solids: The robot's solids.
        poses: Pose X_WF of each solid's frame.
        parameters: Parameters of the matching.
        segmentation: Parameters of the segmentation.

    Raises:
        InputError: If an image has another size than its camera, or the two are exchanged.
    """
    left, right = rectify_images(left, right, rectification)
    if left.ndim == 2:
        left = np.repeat(left[..., None], 3, axis=2)
    greys = to_gray(left), to_gray(right)
    disparity = match(*greys, rectification, parameters)
    if np.mean(disparity > 0) < parameters.few_matches and are_exchanged(
        *greys, rectification, parameters
    ):
        raise InputError(
            "stereo: the images match only the other way round; exchange left and right."
        )
    things = segment_disparity(disparity, left[..., :3], segmentation)
    body = body_mask(solids, poses, X_WC, rectification.intrinsics, parameters.body_margin)
    depth = disparity_to_depth(disparity, rectification)
    depth[(things == 0) | body] = 0
    return StereoResult(depth, disparity, things, body, left[..., :3])
