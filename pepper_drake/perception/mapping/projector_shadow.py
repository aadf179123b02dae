"""The shadow of a depth camera's pattern projector, in which nothing is measured.

See `cameras.structured_light` for what makes it. On which side of the camera the projector is
depends on the robot's model and on whether its images are mirrored, so it is learned from shadows.
"""

from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt

from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.cameras.structured_light import projector_displacement
from pepper_drake.perception.mapping.depth_holes import (
    DEFAULT_HOLES,
    Array,
    HoleMemory,
    HoleParameters,
    Mask,
    Points,
)

BOTH_SIDES = (1, -1)
"""Sides of the camera on which a projector may be: signs of its x in the camera frame."""


def learn_projector_side(
    memory: HoleMemory,
    depth: Array,
    intrinsics: CameraIntrinsics,
    baseline: float,
    parameters: HoleParameters = DEFAULT_HOLES,
) -> HoleMemory:
    """Updates the memory with an image's shadows.

    The blank part of a row beside an edge is a shadow if it is as wide as the pattern's
    displacement between the depths z1 < z2 at its ends, f b (1 / z1 - 1 / z2). The projector is on
    the side of the nearer end.

    Args:
        memory: The previous memory.
        depth: Depth image (height, width) [m], 0 for holes.
        intrinsics: The camera.
        baseline: Distance of projector and camera [m].
        parameters: Tolerances of a shadow.
    """
    width = depth.shape[1]
    change = np.diff((depth == 0).astype(np.int8), axis=1)
    begins, ends = (np.flatnonzero(np.pad(change == sign, ((0, 0), (1, 0)))) for sign in (1, -1))
    # The end that follows each beginning in its row; a row may end without one.
    next_end = np.searchsorted(ends, begins)
    begins, next_end = begins[next_end < len(ends)], next_end[next_end < len(ends)]
    ends = ends[next_end]
    in_row = begins // width == ends // width
    begins, ends = begins[in_row], ends[in_row]
    left, right = depth.ravel()[begins - 1], depth.ravel()[ends]
    shift = intrinsics.focal_x * baseline * (1.0 / right - 1.0 / left)
    shadow = np.abs(ends - begins - np.abs(shift)) <= parameters.side_slack
    shadow &= np.abs(shift) >= parameters.side_width
    positive, negative = memory.shadows
    return replace(
        memory,
        shadows=(
            positive + int(np.count_nonzero(shadow & (shift > 0.0))),
            negative + int(np.count_nonzero(shadow & (shift < 0.0))),
        ),
    )


def projector_sides(
    memory: HoleMemory, parameters: HoleParameters = DEFAULT_HOLES
) -> tuple[int, ...]:
    """Returns the sides on which the projector may be: one of `BOTH_SIDES` once it is known."""
    positive, negative = memory.shadows
    if positive + negative >= parameters.side_rows:
        for side, more, fewer in ((1, positive, negative), (-1, negative, positive)):
            if more >= parameters.side_ratio * fewer:
                return (side,)
    return BOTH_SIDES


def in_measured_shadow(
    p_C: Points,
    depth: Array,
    intrinsics: CameraIntrinsics,
    baseline: float,
    parameters: HoleParameters = DEFAULT_HOLES,
    *,
    sides: tuple[int, ...] = BOTH_SIDES,
) -> Mask:
    """Tells which hidden places lie in the projector's shadow of a measured surface.

    The line from a place to the projector appears in the image as part of the place's row: at d
    pixels from it, the inverse depth is larger by d / (f b). A surface measured at that depth
    blocks the pattern. As the depth of the hidden surface may be unknown, the depth at which the
    row's blank run ends is tried, too.

    Args:
        p_C: Hidden places (N, 3) in the camera frame [m], all in the field of view.
        depth: Depth image (height, width) [m], 0 for holes.
        intrinsics: The camera.
        baseline: Distance of projector and camera [m].
        parameters: Tolerances of a shadow.
        sides: Sides of the camera on which the projector may be.

    Returns:
        (N,).
    """
    reach = abs(intrinsics.focal_x * baseline)
    if len(p_C) == 0 or reach == 0.0:
        return np.zeros(len(p_C), dtype=bool)
    columns, rows = np.rint(intrinsics.project(p_C)).astype(np.int64).T
    # A minimum filter, as edge pixels often drop out.
    filled = np.where(depth > 0, depth, np.float32(np.inf))
    nearest = cv2.erode(filled, np.ones((3, 3), np.uint8))
    with np.errstate(divide="ignore"):
        inverse = 1.0 / nearest
    ends = _run_ends(depth, columns, rows)
    # The displacement of a measurable surface is at most this.
    steps = np.arange(1, int(np.ceil(reach / intrinsics.near)) + 1)
    explained = np.zeros(len(p_C), dtype=bool)
    for z in (p_C[:, 2], ends):
        start = projector_displacement(z, intrinsics.focal_x, baseline)
        expected = (np.abs(start)[:, None] + steps) / reach
        for side in sides:
            at = columns[:, None] + side * steps
            inside = (at >= 0) & (at < intrinsics.width)
            found = inverse[rows[:, None], np.clip(at, 0, intrinsics.width - 1)]
            off = np.abs(found - expected) * reach
            with np.errstate(invalid="ignore"):  # 0 * inf: a hole in a run without an end.
                nearer = found * (z[:, None] - parameters.shadow_step) > 1.0
            explained |= (inside & nearer & (off <= parameters.shadow_slack)).any(axis=1)
    return explained


def _run_ends(
    depth: Array, columns: npt.NDArray[np.int64], rows: npt.NDArray[np.int64]
) -> npt.NDArray[np.float64]:
    """Returns the larger depth (N,) at the ends of the rows' blank runs [m]; inf if none."""
    width = depth.shape[1]
    lines, line_of = np.unique(rows, return_inverse=True)
    some = depth[lines]
    places = np.where(some > 0, np.arange(width), -1)
    left = np.maximum.accumulate(places, axis=1)[line_of, columns]
    places = np.where(some > 0, np.arange(width), width)
    right = np.minimum.accumulate(places[:, ::-1], axis=1)[:, ::-1][line_of, columns]
    far = np.zeros(len(columns))
    for end, valid in ((left, left >= 0), (right, right < width)):
        z = some[line_of, np.clip(end, 0, width - 1)]
        far = np.where(valid, np.maximum(far, z), far)
    return np.where(far > 0.0, far, np.inf)
