"""The scale of a depth image, from a thing whose place is known by other means."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.perception.cameras.camera import CameraIntrinsics, pixel_rays
from pepper_drake.perception.mapping.solids import Solid, SolidSet

Vector = npt.NDArray[np.float64]

_MOST_PIXELS = 64
"""Largest number of pixels along an edge of the part of the image that is looked at."""
_LEAST_PIXELS = 12
"""Smallest number of pixels of the thing, and of its support, that tell a scale."""
_AROUND = 0.1
"""Width of the support beside the thing that is looked at [m]."""
_STEPS, _TOUCH = 48, 5e-4
"""Largest number of steps along a ray, and distance at which it has arrived [m]."""


def ray_depths(solids: SolidSet, rays: Vector, first: float, last: float) -> Vector:
    """Returns depths (N,) at which rays first meet solids [m], infinite for those that miss.

    Steps along each ray as far as the nearest solid is away (sphere tracing, Hart 1996,
    doi:10.1007/s003710050084).

    Args:
        solids: In the camera's frame.
        rays: Scaled to unit depth (N, 3).
        first: Depth at which to start, before all solids [m].
        last: Depth behind them [m].
    """
    lengths = np.linalg.norm(rays, axis=1)
    depths: Vector = np.full(len(rays), max(first, 0.0))
    left = np.arange(len(rays))
    for _ in range(_STEPS):
        distance = solids.distance(depths[left, None] * rays[left])
        depths[left] += np.where(distance > _TOUCH, distance / lengths[left], 0.0)
        depths[left[depths[left] > last]] = np.inf
        left = left[(distance > _TOUCH) & np.isfinite(depths[left])]
        if not len(left):
            break
    depths[left] = np.inf  # Those that pass close by.
    return depths


def depth_scale(
    depth: npt.NDArray[np.float32],
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    X_WO: RigidTransform,
    solids: Sequence[Solid],
    robot: SolidSet | None,
    *,
    robot_margin: float,
    spread: float,
) -> float:
    """Returns measured depths of a thing and its support as a multiple of what its pose says.

    A thing by itself does not tell: a camera sees through glass, and another thing may hide it
    evenly. With the wrong scale, what it stands on is off by the same factor.

    Args:
        depth: Depth image (height, width) [m], 0 for holes.
        intrinsics: The camera.
        X_WC: Its pose.
        X_WO: The thing's pose, not from depth images; it stands upright on its origin.
        solids: The thing's shapes in O.
        robot: What may be before it, in W; None if nothing of the robot.
        robot_margin: Distance within which points belong to the robot [m].
        spread: Largest difference between the multiples of most pixels.

    Returns:
        The median; NaN if too little of thing or support is seen, or the multiples differ.
    """
    X_CO, p_WC = X_WC.InvertAndCompose(X_WO), X_WC.translation()
    reach = max(
        float(np.linalg.norm(solid.X_FS.translation())) + solid.bounding_radius for solid in solids
    )
    p_CO = X_CO.translation()
    around = max(solid.width for solid in solids) + _AROUND
    nearest = float(p_CO[2] - max(reach, around))
    if not nearest > intrinsics.near:
        return np.nan
    size = np.array([intrinsics.width, intrinsics.height])
    span = np.array([intrinsics.focal_x, intrinsics.focal_y]) * max(reach, around) / nearest
    low, high = (
        np.clip(intrinsics.project(p_CO) + side * span, 0, size).astype(int) for side in (-1, 1)
    )
    stride = max(1, int(np.max(high - low)) // _MOST_PIXELS)
    part = np.ix_(np.arange(low[1], high[1], stride), np.arange(low[0], high[0], stride))
    rays, measured = pixel_rays(intrinsics)[part].astype(float), depth[part].astype(float)
    if not measured.size:
        return np.nan
    placed = SolidSet.posed(solids, [X_CO] * len(solids))
    on_thing = ray_depths(placed, rays.reshape(-1, 3), nearest, float(p_CO[2]) + reach)
    on_thing = on_thing.reshape(measured.shape)
    directions = rays @ X_WC.rotation().matrix().T
    with np.errstate(divide="ignore", invalid="ignore"):
        on_support = (X_WO.translation()[2] - p_WC[2]) / directions[..., 2]
        offset = (p_WC + on_support[..., None] * directions - X_WO.translation())[..., :2]
    beside = np.linalg.norm(offset, axis=-1)
    hits = np.isfinite(on_thing)
    seen = measured > 0.0
    if robot is not None:
        p_W = measured[seen][:, None] * directions[seen] + p_WC
        seen[seen] = ~robot.near(p_W, robot_margin)
    thing, support = seen & hits, seen & ~hits & (beside < around)
    if min(np.count_nonzero(thing), np.count_nonzero(support)) < _LEAST_PIXELS:
        return np.nan
    # Outside these are pixels at its outline, which may show what is behind it.
    low_scale, scale, high_scale = np.quantile(measured[thing] / on_thing[thing], [0.2, 0.5, 0.8])
    agrees = np.abs(measured[support] / on_support[support] - scale) < 0.5 * spread
    return float(scale) if high_scale - low_scale < spread and agrees.mean() > 0.5 else np.nan
