"""Infers obstacles inside the depth camera's near limit from what they occlude.

Objects inside the near limit are not measured and leave a hole in the image. A hole means an
obstacle if a known surface, such as the floor, is expected there, neither the robot nor another
known object blocks the view or the projector's light, and the sensor does not explain it (see
`depth_holes`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from scipy.spatial import cKDTree

from pepper_drake.perception.cameras.camera import CameraIntrinsics, pixel_rays
from pepper_drake.perception.mapping.depth_holes import (
    DEFAULT_HOLES,
    HoleMemory,
    HoleParameters,
    blank_pixels,
    learn_blindness,
    learn_dropouts,
)
from pepper_drake.perception.mapping.projector_shadow import (
    BOTH_SIDES,
    in_measured_shadow,
    learn_projector_side,
)
from pepper_drake.perception.mapping.solids import ExcludedSolids
from pepper_drake.perception.mapping.voxel_map import one_per_voxel

Points = npt.NDArray[np.floating]
Mask = npt.NDArray[np.bool_]

_PITCH = 6
"""Stride of rays [pixels]."""
_STEP = 0.02
"""Step between points on a ray [m]."""
_BORDER = 12
"""Width at the left and right border of an image where a surface may not be measured [pixels]."""
_BESIDE = 0.03
"""Distance within which a ray passes a known point [m]: two of the map's voxels."""


@dataclass(unsafe_hash=True)
class NearFieldParameters:
    """Parameters of inferring what is inside the camera's near limit.

    Attributes:
        beyond: Margin beyond the near limit from which occluded surfaces count [m].
        farthest: Largest depth of the background [m].
        spacing: Spacing of the background's points [m].
        nearest: Smallest depth of an inferred obstacle [m], ...
        usual_nearest: ... and its usual smallest depth [m].
        margin: Distance beyond the near limit up to which a ray is followed [m].
        around_known: Distance to a known object within which it may occlude [m], as only one side
            of it is known.
        moved_extent: Distance from points of an object that moved up to which the background may
            have been part of it, and may have left [m].
        on_table: Height above the table up to which points belong to it [m].
        floor: Height up to which points belong to the floor [m].
        grazing: Cosine of the angle of incidence below which floor and table need not be measured.
        support_rim: Width around the goal object of its support, which may occlude, too [m].
        support_thickness: Thickness of the support [m].
        min_rays: Fewer rays are noise.
        retention_time: Time for which an inferred obstacle is kept [s].
    """

    beyond: float = 0.05
    farthest: float = 3.0
    spacing: float = 0.03
    nearest: float = 0.15
    usual_nearest: float = 0.25
    margin: float = 0.03
    around_known: float = 0.05
    moved_extent: float = 0.6
    on_table: float = 0.02
    floor: float = 0.03
    grazing: float = 0.25
    support_rim: float = 0.045
    support_thickness: float = 0.025
    min_rays: int = 4
    retention_time: float = 2.0


DEFAULT_NEAR_FIELD = NearFieldParameters()
"""Default parameters."""


def background_points(
    before: Points,
    depth: npt.NDArray[np.float32],
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    parameters: NearFieldParameters = DEFAULT_NEAR_FIELD,
) -> npt.NDArray[np.float64]:
    """Returns background points, visible unless occluded: all surfaces including floor and table.

    Args:
        before: (P, 3) background points before this image, in W [m].
        depth: Depth image (height, width) [m], 0 for holes.
        intrinsics: The camera.
        X_WC: Its pose when the image was taken.
        parameters: Limits of the background.

    Returns:
        (Q, 3) the image's points, and the earlier ones in its holes or outside the image.
    """
    if depth.size == 0:
        return np.asarray(before, dtype=float)
    kept = np.ones(len(before), dtype=bool)
    p_C = _in_camera(before, X_WC)
    inside = np.flatnonzero((p_C[:, 2] > 0.0) & intrinsics.sees(p_C))
    columns, rows = _pixels(p_C[inside], intrinsics)
    kept[inside] = blank_pixels(depth)[rows, columns]
    half = _PITCH // 2
    z = depth[half::_PITCH, half::_PITCH]
    rays = pixel_rays(intrinsics, _PITCH)
    measured = (z > intrinsics.near + parameters.beyond) & (z < parameters.farthest)
    p_W = (rays[measured] * z[measured][:, None]) @ X_WC.rotation().matrix().T
    points = np.concatenate((p_W + X_WC.translation(), before[kept]))
    return np.asarray(points[one_per_voxel(points, parameters.spacing)])


def unexplained_holes(
    memory: HoleMemory,
    behind: Points,
    depth: npt.NDArray[np.float32],
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    table: float = -np.inf,
    *,
    baseline: float = 0.0,
    parameters: NearFieldParameters = DEFAULT_NEAR_FIELD,
    hole_parameters: HoleParameters = DEFAULT_HOLES,
) -> tuple[HoleMemory, Mask]:
    """Finds the holes of an image that neither the sensor nor the surface behind explains.

    Args:
        memory: Memory of holes in earlier images.
        behind: (B, 3) background points, visible unless occluded, in W [m].
        depth: Depth image (height, width) [m], 0 for holes.
        intrinsics: The camera.
        X_WC: Its pose when the image was taken.
        table: Height of the table on which objects stand, in W [m].
        baseline: Distance of the camera from its projector [m]; 0 without a projector.
        parameters: Parameters of the expected image.
        hole_parameters: Parameters of explaining holes.

    Returns:
        The memory of holes, and the mask (height, width) of the blank pixels of unexplained holes.
    """
    _, expected = _expected(behind, intrinsics, X_WC, table, parameters)
    memory = learn_blindness(memory, depth, expected, intrinsics, X_WC, hole_parameters)
    memory = learn_projector_side(memory, depth, intrinsics, baseline, hole_parameters)
    blank = blank_pixels(depth, memory.blind_pixels(hole_parameters))
    memory, explained = learn_dropouts(memory, depth, blank, intrinsics, X_WC, hole_parameters)
    return memory, blank & ~explained


def occluded_points(
    behind: Points,
    known: Points,
    depth: npt.NDArray[np.float32],
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    ignored: Sequence[ExcludedSolids],
    table: float = -np.inf,
    *,
    holes: Mask | None = None,
    moved: Points | None = None,
    baseline: float = 0.0,
    sides: tuple[int, ...] = BOTH_SIDES,
    parameters: NearFieldParameters = DEFAULT_NEAR_FIELD,
    hole_parameters: HoleParameters = DEFAULT_HOLES,
) -> npt.NDArray[np.float64]:
    """Finds possible positions of obstacles too near to be measured.

    Args:
        behind: (B, 3) background points, visible unless occluded, in W [m]; the floor, z = 0, is
            added.
        known: (P, 3) points on known obstacles, in W [m].
        depth: Depth image (height, width) [m], 0 for holes.
        intrinsics: The camera.
        X_WC: Its pose when the image was taken.
        ignored: The robot and the goal object at that time.
        table: Height of the table on which objects stand, in W [m].
        holes: From `unexplained_holes`; all holes of the image if omitted.
        moved: (M, 3) points of objects that appeared in free space, in W [m]; none if omitted. What
            an object has left may be blank, too, where there is no floor behind it.
        baseline: Distance of the camera from its projector [m]; 0 without a projector.
        sides: Sides of the camera on which the projector may be, from `projector_sides`.
        parameters: Parameters of inferred obstacles.
        hole_parameters: Parameters of shadows.

    Returns:
        (Q, 3) points in W [m], on the rays through such holes, up to the near limit; none for an
        image without any measurement.
    """
    nothing = np.zeros((0, 3))
    if not depth.any():
        return nothing
    ahead, (columns, rows) = _expected(behind, intrinsics, X_WC, table, parameters)
    hidden = (blank_pixels(depth) if holes is None else holes)[rows, columns]
    squares = columns[hidden] // _PITCH + (rows[hidden] // _PITCH) * intrinsics.width
    ahead = ahead[hidden][np.unique(squares, return_index=True)[1]]
    if moved is not None and len(moved):
        ahead = ahead[~_may_have_left(ahead, moved, X_WC, parameters)]
    if len(ahead) >= parameters.min_rays:
        shadow = in_measured_shadow(
            ahead, depth, intrinsics, baseline, hole_parameters, sides=sides
        )
        ahead = ahead[~shadow]
    depths = np.arange(parameters.nearest, intrinsics.near + parameters.margin, _STEP)
    R_WC, p_WC = X_WC.rotation().matrix(), X_WC.translation()
    near = np.asarray(known[np.sum((known - p_WC) ** 2, axis=1) < (2 * intrinsics.near) ** 2])
    is_table = near[:, 2] < table + parameters.on_table
    trees = [
        (cKDTree(some), margin)
        for some, margin in (
            (near[~is_table], parameters.around_known),
            (near[is_table], parameters.on_table),
        )
        if len(some)
    ]
    # Rays from the camera, and from where the projector may be.
    for origin in (0.0,) if baseline == 0.0 else (0.0, *(side * baseline for side in sides)):
        if len(ahead) < parameters.min_rays:
            return nothing
        p_CO = np.array([origin, 0.0, 0.0])
        rays_C = p_CO + (ahead - p_CO)[:, None] * (depths[:, None] / ahead[:, None, 2:])
        points = (rays_C @ R_WC.T + p_WC).reshape(-1, 3)
        explained = np.zeros(len(points), dtype=bool)
        for tree, margin in trees:
            explained |= np.isfinite(tree.query(points, distance_upper_bound=margin)[0])
        for each in ignored:
            explained |= each.placed.near(points, each.margin)
        ahead = ahead[~explained.reshape(len(ahead), -1).any(axis=1)]
        if origin != 0.0 and len(ahead):
            # Shadows of what is outside the image.
            beside = _beside_image(known, intrinsics, X_WC)
            first, step = depths[-1] + _STEP, hole_parameters.shadow_step
            ahead = ahead[~_shadowed(ahead, p_CO, X_WC, ignored, beside, first, step)]
    if len(ahead) < parameters.min_rays:
        return nothing
    likely = depths[depths >= parameters.usual_nearest]
    rays_C = (ahead / ahead[:, 2:])[:, None] * likely[:, None]
    return np.asarray((rays_C @ R_WC.T + p_WC).reshape(-1, 3))


def _may_have_left(
    ahead: Points, moved: Points, X_WC: RigidTransform, parameters: NearFieldParameters
) -> Mask:
    """Tells which background points (N, 3) in C may have been of an object that moved (M, 3) in W.

    Behind them no floor is near enough to be measured now.
    """
    p_W = ahead @ X_WC.rotation().matrix().T + X_WC.translation()
    distance = cKDTree(moved).query(p_W, distance_upper_bound=parameters.moved_extent)[0]
    height = X_WC.translation()[2]
    down = height - p_W[:, 2]
    sees_floor = ahead[:, 2] * height < parameters.farthest * down
    return np.asarray(np.isfinite(distance) & ~sees_floor)


def _shadowed(
    ahead: Points,
    p_CO: Points,
    X_WC: RigidTransform,
    ignored: Sequence[ExcludedSolids],
    known: Points,
    first: float,
    step: float,
) -> Mask:
    """Tells which places (N, 3) in C are in a shadow for light from p_CO (3,) [m].

    The shadow of solids, or of known points (P, 3) in W [m], from a depth `first` up to the place's
    own depth less `step` [m].
    """
    depths = np.arange(first, ahead[:, 2].max() - step, _STEP)
    rays_C = p_CO + (ahead - p_CO)[:, None] * (depths[:, None] / ahead[:, None, 2:])
    points = rays_C.reshape(-1, 3) @ X_WC.rotation().matrix().T + X_WC.translation()
    blocked = np.zeros(len(points), dtype=bool)
    for each in ignored:
        blocked |= each.placed.near(points, each.margin)
    if len(known):
        distance = cKDTree(known).query(points, distance_upper_bound=_BESIDE)[0]
        blocked |= np.isfinite(distance)
    before = depths < ahead[:, 2:] - step
    return np.asarray((blocked.reshape(before.shape) & before).any(axis=1))


def _beside_image(known: Points, intrinsics: CameraIntrinsics, X_WC: RigidTransform) -> Points:
    """Returns the points of (P, 3) in W [m] before the camera but not in the image's interior."""
    p_C = _in_camera(known, X_WC)
    u = intrinsics.project(np.where(p_C[:, 2:] > 0.0, p_C, [0.0, 0.0, 1.0]))[:, 0]
    inside = (u > _BORDER) & (u < intrinsics.width - 1 - _BORDER)
    return np.asarray(known[(p_C[:, 2] > 0.0) & ~inside])


def _expected(
    behind: Points,
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    table: float,
    parameters: NearFieldParameters,
) -> tuple[npt.NDArray[np.float64], tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]]:
    """Returns the points (N, 3) in C expected in an image [m], with columns and rows (N,).

    Floor and table are not expected where they are seen at a grazing angle.
    """
    behind = np.concatenate((behind, _floor(intrinsics, X_WC, parameters.farthest)))
    offset = X_WC.translation() - behind
    level = (behind[:, 2] < parameters.floor) | (np.abs(behind[:, 2] - table) < parameters.on_table)
    grazing = level & (np.abs(offset[:, 2]) < parameters.grazing * np.linalg.norm(offset, axis=1))
    p_C = _in_camera(behind[~grazing], X_WC)
    ahead = p_C[(p_C[:, 2] > intrinsics.near + parameters.beyond) & intrinsics.sees(p_C)]
    columns, rows = _pixels(ahead, intrinsics)
    return ahead, (columns, rows)


def _floor(
    intrinsics: CameraIntrinsics, X_WC: RigidTransform, farthest: float
) -> npt.NDArray[np.float64]:
    """Returns the intersections (N, 3) [m] of rays with the floor, z = 0 in W, up to a depth."""
    rays_C = pixel_rays(intrinsics, _PITCH).reshape(-1, 3).astype(float)
    rays_W = rays_C @ X_WC.rotation().matrix().T
    p_WC = X_WC.translation()
    downward = rays_W[:, 2] * farthest < -p_WC[2]
    if p_WC[2] <= 0.0 or not downward.any():
        return np.zeros((0, 3))
    rays_W = rays_W[downward]
    return np.asarray(p_WC - (p_WC[2] / rays_W[:, 2])[:, None] * rays_W)


def _in_camera(p_W: Points, X_WC: RigidTransform) -> npt.NDArray[np.float64]:
    """Transforms points (N, 3) from W to the camera frame [m]."""
    p_C = (np.asarray(p_W, dtype=float) - X_WC.translation()) @ X_WC.rotation().matrix()
    return np.asarray(p_C)


def _pixels(p_C: Points, intrinsics: CameraIntrinsics) -> npt.NDArray[np.int64]:
    """Returns the columns and rows (2, N) of points (N, 3) in the field of view."""
    return np.rint(intrinsics.project(p_C)).astype(np.int64).T
