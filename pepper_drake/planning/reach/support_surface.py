"""Extrapolation of the unseen part of the surface on which the goal object stands.

A camera close to the goal sees only a part of the table. A planner would take the rest for free
space and prefer to swing out sideways over it. So the surface is extrapolated along its front edge.
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
    """Largest height difference of the surface's points to the goal object's bottom [m]."""
    stripe: float = 0.04
    """Width of the stripes in which the front edge is searched for [m]."""
    min_stripes: int = 5
    """Least number of stripes that define an edge."""
    aside: float = 0.5
    """Extent of the extrapolated surface to the sides [m]."""
    depth: float = 0.2
    """Extent of the extrapolated surface behind its edge [m]."""
    spacing: float = 0.02
    """Distance between its points [m]."""
    ragged: float = 0.012
    """Tolerance of points on a straight edge [m]."""
    rim: float = NearFieldParameters.support_rim
    """Width of the support surface assumed around the goal object where none was seen [m]."""


def extrapolate_support_surface(
    cloud_W: Vector, p_WO: Vector, p_WB: Vector, params: SupportSurfaceParams
) -> Vector:
    """Returns points (K, 3) of the surface beside its observed part [m].

    The front edge is where the surface begins in front of the goal, stripe by stripe. Far to the
    sides the fan-shaped view may begin behind the edge: those stripes are ignored.

    Args:
        cloud_W: Observed points (P, 3).
        p_WO: Bottom of the goal object (3,).
        p_WB: Position of the base (2,) or longer.
        params: Tolerances of the surface and extent of its extrapolation.

    Returns:
        (K, 3), empty if no surface was seen.
    """
    x, y = _surface(cloud_W, p_WO, p_WB, params)
    ahead = p_WO[:2] - p_WB[:2]
    distance = np.linalg.norm(ahead)
    if len(x) < params.min_stripes or distance < 1e-6:
        return np.zeros((0, 3))
    ahead = ahead / distance
    left = np.array([-ahead[1], ahead[0]])
    along, depth = x * left[0] + y * left[1], x * ahead[0] + y * ahead[1]
    stripes = np.floor(along / params.stripe).astype(int)
    first = stripes.min()
    front = np.full(stripes.max() - first + 1, np.inf)
    np.minimum.at(front, stripes - first, depth)
    seen = np.flatnonzero(np.isfinite(front))
    if len(seen) < params.min_stripes:
        return np.zeros((0, 3))
    middles = (first + seen + 0.5) * params.stripe
    slope, offset = _front_line(middles, front[seen], params.ragged)
    behind = depth - (offset + slope * along)
    beyond = np.arange(params.spacing, params.aside, params.spacing)
    rows = []
    for row in np.arange(0.0, params.depth, params.spacing):
        of_row = along[np.abs(behind - row) < params.spacing]
        if len(of_row):
            aside = np.concatenate((of_row.min() - beyond, of_row.max() + beyond))
            forward = offset + slope * aside + row
            rows.append(p_WB[:2] + forward[:, None] * ahead + aside[:, None] * left)
    xy = np.concatenate(rows) if rows else np.zeros((0, 2))
    return np.column_stack((xy, np.full(len(xy), p_WO[2])))


def assumed_support(
    cloud_W: Vector, p_WO: Vector, radius: float, params: SupportSurfaceParams
) -> Vector:
    """Returns points (K, 3) of the assumed support under the goal object if none was seen [m].

    An object at rest stands on something, even if that is closer than the depth camera's range.

    Args:
        cloud_W: Observed points (P, 3).
        p_WO: Bottom of the goal object (3,).
        radius: Radius of the goal object [m].
        params: Extent of the support.

    Returns:
        A disc, or none, (0, 3), where something was seen at that height.
    """
    width = radius + params.rim
    x, y = _surface(cloud_W, p_WO, p_WO, params)
    if (x * x + y * y).min(initial=np.inf) < width * width:
        return np.zeros((0, 3))
    steps = params.spacing * np.arange(-np.ceil(width / params.spacing), width / params.spacing + 1)
    x, y = np.meshgrid(steps, steps)
    within = np.hypot(x, y) <= width
    return p_WO + np.column_stack((x[within], y[within], np.zeros(np.count_nonzero(within))))


def _surface(
    cloud_W: Vector, p_WO: Vector, origin: Vector, params: SupportSurfaceParams
) -> tuple[Vector, Vector]:
    """Returns x and y (S,) from an origin of the points at the height of the goal's bottom [m]."""
    surface = cloud_W.compress(np.abs(cloud_W[:, 2] - p_WO[2]) < params.thickness, axis=0)
    return surface[:, 0] - origin[0], surface[:, 1] - origin[1]


def _front_line(y: Vector, front: Vector, ragged: float) -> tuple[float, float]:
    """Returns slope and offset of the edge x = offset + slope y of stripes that begin at `front`.

    The edge is the side of their convex hull that faces the robot, at y = 0, refined by least
    squares through all stripes (N,) that begin within `ragged` [m] of it.
    """
    best = (0.0, float(front.min()))
    # Of the lines through one stripe on either side, the one that is nearest at y = 0.
    i, j = np.nonzero((y[:, None] <= 0.0) & (y > 0.0))
    if len(i):
        rise = (front[j] - front[i]) / (y[j] - y[i])
        offsets = front[i] - rise * y[i]
        nearest = int(np.argmin(offsets))
        best = (float(rise[nearest]), float(offsets[nearest]))
    slope, offset = best
    on = front <= offset + slope * y + ragged
    if np.count_nonzero(on) < 2:
        return best
    y, front = y[on], front[on]
    aside, middle = y - y.mean(), float(front.mean())
    slope = float(aside @ front / (aside @ aside))
    return slope, middle - slope * float(y.mean())
