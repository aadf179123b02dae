"""What was not seen of the surface on which the goal object stands.

A camera that looks at the goal from near sees a part of a table only. To a search for free space
the rest looks free, and swinging out sideways, over where nothing was seen, looks best of all. So
the surface is taken to go on along its front edge.
"""

import numpy as np
import numpy.typing as npt
from scipy.stats import theilslopes

Vector = npt.NDArray[np.float64]

_THICKNESS = 0.025
"""How far points may be from the goal object's bottom and belong to the surface, m."""
_BIN = 0.04
"""Width of the stripes in which the front edge is looked for, m."""
_FEWEST = 5
"""Stripes that it takes to see an edge."""
_BEYOND = 0.5
"""How far the surface is taken to go on, m."""
_DEPTH = 0.2
"""How deep, from the edge, m."""
_SPACING = 0.02


def supposed_surface(cloud_W: Vector, p_WO: Vector, p_WB: Vector) -> Vector:
    """Points (K, 3) of the surface beside what was seen of it, m.

    The front edge is the line through the points nearest to the robot, stripe by stripe, by the
    median of slopes (Theil 1950, Sen 1968), which stripes that are half hidden do not bend.

    Args:
        cloud_W: (P, 3) what was seen.
        p_WO: (3,) the goal object's bottom.
        p_WB: (2,) or more: where the robot is.

    Returns:
        None, (0, 3), where no surface was seen.
    """
    on = cloud_W[np.abs(cloud_W[:, 2] - p_WO[2]) < _THICKNESS]
    ahead = p_WO[:2] - p_WB[:2]
    distance = np.linalg.norm(ahead)
    if len(on) < _FEWEST or distance < 1e-6:
        return np.zeros((0, 3))
    ahead = ahead / distance
    left = np.array([-ahead[1], ahead[0]])
    along = (on[:, :2] - p_WB[:2]) @ left
    depth = (on[:, :2] - p_WB[:2]) @ ahead
    stripes = np.floor(along / _BIN).astype(int)
    numbers, index = np.unique(stripes, return_inverse=True)
    if len(numbers) < _FEWEST:
        return np.zeros((0, 3))
    front = np.full(len(numbers), np.inf)
    np.minimum.at(front, index, depth)
    slope, offset = theilslopes(front, (numbers + 0.5) * _BIN)[:2]
    behind = depth - (offset + slope * along)
    beyond = np.arange(_SPACING, _BEYOND, _SPACING)
    rows = []
    for deep in np.arange(0.0, _DEPTH, _SPACING):
        seen = along[np.abs(behind - deep) < _SPACING]
        if len(seen):
            y = np.concatenate((seen.min() - beyond, seen.max() + beyond))
            x = offset + slope * y + deep
            rows.append(p_WB[:2] + x[:, None] * ahead + y[:, None] * left)
    xy = np.concatenate(rows) if rows else np.zeros((0, 2))
    return np.column_stack((xy, np.full(len(xy), p_WO[2])))
