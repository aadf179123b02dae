"""Extrapolation of the unseen part of the surface on which the goal object stands.

A camera that looks at the goal from near sees a part of a table only. To a search for free space
the rest looks free, and swinging out sideways, over where nothing was seen, looks best of all. So
the surface is taken to go on along its front edge.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.perception.mapping.near_field_occlusion import NearFieldParameters

Vector = npt.NDArray[np.float64]


@dataclass
class SupportSurfaceParams:
    """Extent of the support surface under the goal object, and of its extrapolation."""

    thickness: float = 0.025
    """Height tolerance of the surface's points to the goal object's bottom [m]."""
    stripe: float = 0.04
    """Width of the stripes in which the front edge is looked for [m]."""
    least_stripes: int = 5
    """Stripes that it takes to see an edge."""
    aside: float = 0.5
    """Extent of the extrapolated surface to the sides [m]."""
    depth: float = 0.2
    """The same from its edge [m]."""
    spacing: float = 0.02
    """Distance between its points [m]."""
    ragged: float = 0.012
    """Tolerance of points on a straight edge [m]."""
    rim: float = NearFieldParameters.support_rim
    """Width around the goal object of what it stands on where nothing of that was seen [m]."""


def extrapolate_support_surface(
    cloud_W: Vector, p_WO: Vector, p_WB: Vector, params: SupportSurfaceParams
) -> Vector:
    """Points (K, 3) of the surface beside what was seen of it [m].

    The front edge is where the surface begins in front of the goal, stripe by stripe. Farther aside
    the view, which is a fan, may begin behind the edge: those stripes do not count.

    Args:
        cloud_W: (P, 3) what was seen.
        p_WO: (3,) the goal object's bottom.
        p_WB: (2,) or more: where the robot is.
        params: What counts as surface.

    Returns:
        None, (0, 3), where no surface was seen.
    """
    on = cloud_W[np.abs(cloud_W[:, 2] - p_WO[2]) < params.thickness]
    ahead = p_WO[:2] - p_WB[:2]
    distance = np.linalg.norm(ahead)
    if len(on) < params.least_stripes or distance < 1e-6:
        return np.zeros((0, 3))
    ahead = ahead / distance
    left = np.array([-ahead[1], ahead[0]])
    along = (on[:, :2] - p_WB[:2]) @ left
    depth = (on[:, :2] - p_WB[:2]) @ ahead
    stripes = np.floor(along / params.stripe).astype(int)
    numbers, index = np.unique(stripes, return_inverse=True)
    if len(numbers) < params.least_stripes:
        return np.zeros((0, 3))
    front = np.full(len(numbers), np.inf)
    np.minimum.at(front, index, depth)
    slope, offset = _front_line((numbers + 0.5) * params.stripe, front, params.ragged)
    behind = depth - (offset + slope * along)
    beyond = np.arange(params.spacing, params.aside, params.spacing)
    rows = []
    for deep in np.arange(0.0, params.depth, params.spacing):
        seen = along[np.abs(behind - deep) < params.spacing]
        if len(seen):
            y = np.concatenate((seen.min() - beyond, seen.max() + beyond))
            x = offset + slope * y + deep
            rows.append(p_WB[:2] + x[:, None] * ahead + y[:, None] * left)
    xy = np.concatenate(rows) if rows else np.zeros((0, 2))
    return np.column_stack((xy, np.full(len(xy), p_WO[2])))


def assumed_support(
    cloud_W: Vector, p_WO: Vector, radius: float, params: SupportSurfaceParams
) -> Vector:
    """Points (K, 3) of what the goal object is taken to stand on if nothing of it was seen [m].

    An object at rest stands on something. Nearer than the depth camera measures, that may be all
    that is known of it.

    Args:
        cloud_W: (P, 3) what was seen.
        p_WO: (3,) the goal object's bottom.
        radius: Of the goal object [m].
        params: Its extent.

    Returns:
        A disc, or none, (0, 3), where something was seen at that height.
    """
    width = radius + params.rim
    on = cloud_W[np.abs(cloud_W[:, 2] - p_WO[2]) < params.thickness]
    if len(on) and np.linalg.norm(on[:, :2] - p_WO[:2], axis=1).min() < width:
        return np.zeros((0, 3))
    steps = params.spacing * np.arange(-np.ceil(width / params.spacing), width / params.spacing + 1)
    x, y = np.meshgrid(steps, steps)
    within = np.hypot(x, y) <= width
    return p_WO + np.column_stack((x[within], y[within], np.zeros(np.count_nonzero(within))))


def _front_line(y: Vector, front: Vector, ragged: float) -> tuple[float, float]:
    """Slope and offset of the edge x = offset + slope y from where stripes (N,) at y begin.

    The edge is the side of their convex hull that faces the robot, at y = 0, made better by least
    squares through all stripes that begin there, within `ragged` [m].
    """
    best = (0.0, float(front.min()))
    rise = (front - front[:, None]) / np.where(y == y[:, None], 1.0, y - y[:, None])
    # Of all lines through a stripe on either side, the one below which none begins.
    i, j = np.nonzero((y[:, None] <= 0.0) & (y > 0.0))
    offsets = front[i] - rise[i, j] * y[i]
    below = front < offsets[:, None] + rise[i, j][:, None] * y - 1e-9
    hull = np.flatnonzero(~below.any(axis=1))
    if len(hull):
        best = (float(rise[i, j][hull[0]]), float(offsets[hull[0]]))
    slope, offset = best
    on = front <= offset + slope * y + ragged
    if np.count_nonzero(on) < 2:
        return best
    slope, offset = np.polyfit(y[on], front[on], 1)
    return float(slope), float(offset)
