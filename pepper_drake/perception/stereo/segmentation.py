"""Segmentation of a disparity image into objects, and the mask of the robot itself."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.geometry import Box, Capsule, Cylinder
from pydrake.math import RigidTransform

from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.mapping.solids import Solid

Mask = npt.NDArray[np.bool_]

_ROUND = np.linspace(0, 2 * np.pi, 16, endpoint=False)


@dataclass(unsafe_hash=True)
class SegmentationParameters:
    """Parameters of the segmentation of a disparity image.

    Attributes:
        jump: Smallest step of disparity between two objects [pixels].
        horizontal_slope: Slope of disparity over rows that separates horizontal surfaces, such as
            a table (larger), from objects standing on them [pixels per row]; a table h below the
            camera has baseline / h.
        slope_window: Edge of the window in which the slope is measured, odd [pixels].
        smallest: Segments of fewer pixels are mismatches.
        closing: Holes narrower than this are closed before the segmentation [pixels].
    """

    jump: float = 2.0
    horizontal_slope: float = 0.08
    slope_window: int = 15
    smallest: int = 400
    closing: int = 7


def segment_disparity(
    disparity: npt.NDArray[np.float32],
    image: npt.NDArray[np.uint8],
    parameters: SegmentationParameters,
) -> npt.NDArray[np.int32]:
    """Segments a disparity image into objects: contours, then watershed on the image.

    Contours are drawn around regions without depth discontinuities, horizontal surfaces separately
    from objects standing on them. Watershed then assigns the pixels between them by the image's
    edges.

    Args:
        disparity: (height, width) [pixels], 0 where there is none.
        image: The rectified left image (height, width, 3), 8 bit.
        parameters: Parameters of the segmentation.

    Returns:
        Labels (height, width): 1, 2, ... for the segments, 0 outside all.
    """
    seen = (disparity > 0).astype(np.uint8)
    kernel = np.ones((parameters.closing, parameters.closing), np.uint8)
    closed = cv2.morphologyEx(seen, cv2.MORPH_CLOSE, kernel)
    filled = np.where(seen > 0, disparity, cv2.dilate(disparity, kernel))
    small = np.ones((3, 3), np.uint8)
    steps = cv2.dilate(filled, small) - cv2.erode(filled, small)
    smooth = (closed > 0) & (steps <= parameters.jump)
    reach = parameters.slope_window // 2
    ramp = np.arange(-reach, reach + 1, dtype=np.float32)
    ramp /= np.sum(ramp**2) * len(ramp)
    slope = cv2.sepFilter2D(filled, cv2.CV_32F, np.ones_like(ramp), ramp)
    large = []
    for kind in (slope > parameters.horizontal_slope, slope <= parameters.horizontal_slope):
        cores = cv2.erode((smooth & kind).astype(np.uint8), small)
        contours, _ = cv2.findContours(cores, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
        large += [c for c in contours if cv2.contourArea(c) >= parameters.smallest]
    # Watershed's markers: segments from 2, 1 for the background, 0 for undecided pixels.
    markers = np.where(cv2.dilate(closed, kernel) > 0, 0, 1).astype(np.int32)
    for number, contour in enumerate(large):
        cv2.drawContours(markers, [contour], -1, number + 2, cv2.FILLED)
    if not large:
        return np.zeros(disparity.shape, np.int32)
    labels = cv2.watershed(np.ascontiguousarray(image), markers)
    return np.where((labels >= 2) & (closed > 0), labels - 1, 0).astype(np.int32)


def body_mask(
    solids: Sequence[Solid],
    poses: Sequence[RigidTransform],
    X_WC: RigidTransform,
    intrinsics: CameraIntrinsics,
    margin: float,
) -> Mask:
    """Projects a robot's solids into an image: equation 3.4 of the report, for its whole shape.

    Each solid is convex, so the convex hull of its projected outline is its silhouette.

    Args:
        solids: The robot's solids.
        poses: Pose X_WF of each solid's frame F.
        X_WC: The camera's pose.
        intrinsics: The camera.
        margin: Margin by which the solids are enlarged [m].

    Returns:
        Mask (height, width) of the pixels that the robot covers, with the margin.
    """
    mask = np.zeros((intrinsics.height, intrinsics.width), np.uint8)
    for solid, X_WF in zip(solids, poses, strict=True):
        X_CS = X_WC.InvertAndCompose(X_WF @ solid.X_FS)
        if solid.signed_distance(X_CS.inverse().translation()[None])[0] <= margin:
            continue  # The head, which contains the camera.
        outline = (X_CS @ _outline(solid, margin).T).T
        # A solid that extends behind the camera is clipped just in front of it.
        outline = _clip_ahead(outline, X_CS.translation())
        if len(outline) < 3:
            continue
        pixels = intrinsics.project(outline)
        hull = cv2.convexHull(np.clip(np.rint(pixels), -10_000, 10_000).astype(np.int32))
        cv2.fillConvexPoly(mask, hull, 1)
    return mask > 0


def _outline(solid: Solid, margin: float) -> npt.NDArray[np.float64]:
    """Returns points (N, 3) in the solid's frame whose hull contains it with the margin."""
    shape = solid.shape
    if isinstance(shape, Box):
        half = shape.size() / 2 + margin
        return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    # Radius of a polygon circumscribed about a circle.
    grow = 1 / np.cos(np.pi / len(_ROUND))
    circle = np.column_stack([np.cos(_ROUND), np.sin(_ROUND)])
    if isinstance(shape, Cylinder):
        rim = (shape.radius() + margin) * grow * circle
        half = shape.length() / 2 + margin
        return np.concatenate([np.column_stack([rim, np.full(len(rim), z)]) for z in (-half, half)])
    radius = (shape.radius() + margin) * grow
    half = shape.length() / 2 if isinstance(shape, Capsule) else 0.0
    rows = []
    for side in (-1, 1):
        for latitude in np.linspace(0, np.pi / 2, 5):
            ring = radius * np.cos(latitude) * grow * circle
            height = side * (half + radius * np.sin(latitude))
            rows.append(np.column_stack([ring, np.full(len(ring), height)]))
    return np.concatenate(rows)


def _clip_ahead(
    outline: npt.NDArray[np.float64], center: npt.NDArray[np.float64], nearest: float = 0.02
) -> npt.NDArray[np.float64]:
    """Moves points behind the plane z = `nearest` onto it, towards a point in front of it."""
    ahead = outline[:, 2] >= nearest
    if ahead.all():
        return outline
    anchor = center if center[2] > nearest else outline[outline[:, 2].argmax()]
    if anchor[2] <= nearest:
        return np.zeros((0, 3))
    share = (anchor[2] - nearest) / (anchor[2] - outline[:, 2].clip(max=nearest - 1e-9))
    pulled = anchor + share[:, None] * (outline - anchor)
    return np.where(ahead[:, None], outline, pulled)
