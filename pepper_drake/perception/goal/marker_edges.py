"""Refining a marker's pose on all black-white edges of its pattern, not only on its four sides.

The corners of a marker 1 m away are known to a tenth of a pixel, which is several millimetres of
depth. Its pattern has many more edges. Each is found along the normal of its predicted place, and
the pose that brings all of them together is found by Gauss-Newton steps, as model-based trackers
do (Drummond and Cipolla 2002, doi:10.1109/TPAMI.2002.1017620).
"""

import functools
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.perception.cameras.camera import CameraIntrinsics

Array = npt.NDArray[np.float64]

_SAMPLES = 4
"""Places along one module's edge at which it is looked for."""

_OFFSETS = np.linspace(-1, 1, 11)
"""Places along the normal at which the image is read, as shares of the search range."""

_LONGEST_SEARCH = 3.0
"""Largest search range to either side of an edge [pixels]."""

_SHORTEST_SEARCH = 1.15
"""Search range below which neighbouring edges blur into each other [pixels]."""

_SEARCH_SHARE = 0.45
"""Search range as a share of a module: beyond half of it lies the next edge."""

_OUTLIER = 0.6
"""Edges found farther than this from where the others put them count less [pixels]."""

_LEAST_EDGES = 8
"""Edges of modules without which no pose is fitted."""

_WORST_CONDITION = 1e12
"""Largest condition number of the normal equations in rad and m; a marker 1 m away has 1e7."""

_LEAST_ERROR = 0.02
"""Error of an edge that no residual shows [pixels], ..."""

_NEIGHBOURS = 0.7
"""... and that of one whose module is a pixel wide, as the blurred edges beside it draw it along
[pixels]: it falls with the square of the module's width. Measured, as the next, with 840 drawn
markers of 17 to 60 pixels, at 0.15 to 2.5 times the light."""

_SPILL = 0.15
"""Share of the edges' common offset by which light that spills over changes the marker's size."""

_LEAST_OFFSET = 0.2
"""Edges that are all farther than this towards black or white are of an image exposed too much or
too little [pixels]: their common offset is then fitted, too."""

_LEAST_CONTRAST = 0.35
"""An edge counts as seen when its contrast is at least this share of the median one."""


@dataclass(frozen=True)
class MarkerEdges:
    """The black-white edges of a marker's pattern, sampled.

    Attributes:
        points: (N, 2) on the edges, in sides of the black square, origin in its middle, y up.
        normals: (N, 2) unit vectors from black to white.
        modules: Modules along the side of the black square.
    """

    points: Array
    normals: Array
    modules: int


@dataclass(frozen=True)
class EdgeFit:
    """A pose fitted to a marker's edges.

    Attributes:
        X_CM: The pose.
        error: Root mean square distance of the edges from where the pose puts them [pixels].
        support: Share of the pattern's edges that were seen.
        covariance: (6, 6) of rotation (rad, axes of C) and position (m, in C).
    """

    X_CM: RigidTransform
    error: float
    support: float
    covariance: Array


@functools.lru_cache(maxsize=64)
def marker_edges(dictionary: str, marker_id: int) -> MarkerEdges:
    """Returns the edges of a marker's pattern.

    Args:
        dictionary: Name of an OpenCV dictionary.
        marker_id: The marker's number in it.
    """
    book = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    modules = book.markerSize + 2
    picture = cv2.aruco.generateImageMarker(book, marker_id, modules) > 127
    white = np.pad(picture, 1, constant_values=True)
    along = (np.arange(_SAMPLES) + 1) / (_SAMPLES + 1)
    points, normals = [], []
    # Columns count to the right, rows down; module (row, column) covers [column - 1, column].
    for row, column in np.argwhere(white[:, 1:] != white[:, :-1]):
        points.append(np.column_stack([np.full(_SAMPLES, column), row - 1 + along]))
        normals.append([1.0 if white[row, column + 1] else -1.0, 0.0])
    for row, column in np.argwhere(white[1:] != white[:-1]):
        points.append(np.column_stack([column - 1 + along, np.full(_SAMPLES, row)]))
        normals.append([0.0, 1.0 if white[row + 1, column] else -1.0])
    flip = np.array([1.0, -1.0])
    return MarkerEdges(
        (np.concatenate(points) / modules - 0.5) * flip,
        np.repeat(np.array(normals) * flip, _SAMPLES, axis=0),
        modules,
    )


def refine_on_edges(
    gray: npt.NDArray[np.uint8],
    X_CM: RigidTransform,
    edges: MarkerEdges,
    size: float,
    intrinsics: CameraIntrinsics,
    *,
    iterations: int = 2,
) -> EdgeFit | None:
    """Fits a marker's pose to the edges of its pattern in an image.

    Args:
        gray: The image (height, width).
        X_CM: The pose to start from, right within about a pixel.
        edges: The pattern's edges.
        size: Side of the black square [m].
        intrinsics: The camera.
        iterations: Gauss-Newton steps.

    Returns:
        The fit; None when too few edges are seen to fit a pose.
    """
    fit = _fit(gray, X_CM, edges, size, intrinsics, iterations, offset=None)
    if fit is None or abs(fit[1]) < _LEAST_OFFSET:
        return None if fit is None else fit[0]
    # Too much light makes white wider: all edges are beside where they belong.
    again = _fit(gray, fit[0].X_CM, edges, size, intrinsics, iterations, offset=fit[1])
    return fit[0] if again is None else again[0]


def _fit(
    gray: npt.NDArray[np.uint8],
    X_CM: RigidTransform,
    edges: MarkerEdges,
    size: float,
    intrinsics: CameraIntrinsics,
    iterations: int,
    *,
    offset: float | None,
) -> tuple[EdgeFit, float] | None:
    """Fits the pose, and if an offset [pixels] of all edges towards white is given, that too.

    Returns:
        The fit and the offset; where it was not fitted, what it would be. None when too few edges
        are seen.
    """
    flat = np.zeros((len(edges.points), 1))
    model = np.hstack([edges.points * size, flat])
    normals = np.hstack([edges.normals, flat])
    rotation, translation = X_CM.rotation(), X_CM.translation()
    size_of_state = 6 if offset is None else 7
    shifted = 0.0 if offset is None else offset
    for iteration in range(iterations + 1):
        R = rotation.matrix()
        arm = model @ R.T
        p_C = arm + translation
        if p_C[:, 2].min() <= 0:
            return None
        # A hundredth of the marker along the normal, as it appears in the image.
        ahead = p_C + (0.01 * size) * (normals @ R.T)
        both = intrinsics.project(np.concatenate([p_C, ahead]))
        place = both[: len(p_C)]
        direction = both[len(p_C) :] - place
        length = np.hypot(direction[:, 0], direction[:, 1])
        direction /= length[:, None]
        reach = np.minimum(_SEARCH_SHARE * 100 / edges.modules * length, _LONGEST_SEARCH)
        if reach.min() < _SHORTEST_SEARCH:
            return None
        shift, seen = _find_edges(gray, place + shifted * direction, direction, reach)
        if np.count_nonzero(seen) < _LEAST_EDGES * _SAMPLES:
            return None
        J = np.column_stack(
            [_jacobian(arm[seen], p_C[seen], direction[seen], intrinsics), np.ones(seen.sum())]
        )
        r = shift[seen]
        weight = np.minimum(1.0, _OUTLIER / np.maximum(np.abs(r), 1e-9))
        whole = (J * weight[:, None]).T @ J
        information = whole[:size_of_state, :size_of_state]
        eigenvalues = np.linalg.eigvalsh(information)
        if not eigenvalues[0] * _WORST_CONDITION > eigenvalues[-1]:
            return None
        inverse = np.linalg.inv(information)
        if iteration < iterations:
            step = inverse @ (J[:, :size_of_state].T @ (weight * r))
            rotation = RotationMatrix(cv2.Rodrigues(step[:3])[0]) @ rotation
            translation = translation + step[3:6]
            if offset is not None:
                shifted += float(step[6])
    error = float(np.sqrt(np.average(np.square(r), weights=weight)))
    module = 100 / edges.modules * length[seen]
    drawn = float(np.average((_NEIGHBOURS / module**2) ** 2, weights=weight))
    # The samples of one edge err together.
    variance = float(max(error, _LEAST_ERROR) ** 2 + drawn) * _SAMPLES
    pose = RigidTransform(rotation, translation)
    covariance = np.asarray(variance * inverse[:6, :6], dtype=float)
    along = _SPILL * shifted / (100 * float(np.mean(length))) * translation
    covariance[3:, 3:] += np.outer(along, along)
    if offset is None:
        shifted = float(np.linalg.lstsq(whole, J.T @ (weight * r), rcond=None)[0][6])
    return EdgeFit(pose, error, float(np.mean(seen)), covariance), shifted


def _jacobian(arm: Array, p_C: Array, direction: Array, intrinsics: CameraIntrinsics) -> Array:
    """Jacobian of points along image directions by the marker's rotation and translation.

    Args:
        arm: Points from the marker's origin (N, 3), axes of C.
        p_C: Points in the camera frame (N, 3).
        direction: Image directions (N, 2).
        intrinsics: The camera; that its distortion differs from place to place is neglected.

    Returns:
        (N, 6), pixels for each rad about C's axes and m along them.
    """
    scaled = direction * np.array([intrinsics.focal_x, intrinsics.focal_y]) / p_C[:, 2:]
    x, y, z = arm.T
    u, v = scaled.T
    w = -(u * p_C[:, 0] + v * p_C[:, 1]) / p_C[:, 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u, u, v, w], axis=1)


def _find_edges(
    gray: npt.NDArray[np.uint8], places: Array, direction: Array, reach: Array
) -> tuple[Array, npt.NDArray[np.bool_]]:
    """Finds edges near predicted places.

    Args:
        gray: The image.
        places: Predicted pixel coordinates (N, 2).
        direction: Image directions (N, 2) from dark to bright.
        reach: Search range to either side (N,) [pixels].

    Returns:
        Shift of each edge along its direction (N,), pixels, and which of them were seen (N,).
    """
    steps = reach[:, None] * _OFFSETS
    at = (places[:, None] + steps[..., None] * direction[:, None]).astype(np.float32)
    profile = cv2.remap(
        gray, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    ).astype(float)
    dark, bright = profile[:, :2].mean(axis=1), profile[:, -2:].mean(axis=1)
    contrast = bright - dark
    usual = np.median(contrast)
    seen = contrast > max(_LEAST_CONTRAST * usual, 10.0)
    # Where a step from dark to bright has to be to leave this much light within the range.
    fill = np.mean((profile - dark[:, None]), axis=1) / np.where(seen, contrast, 1.0)
    shift = reach * (1 - 2 * fill)
    height, width = gray.shape
    border = _LONGEST_SEARCH
    inside = np.all(
        (places > border) & (places < [width - 1 - border, height - 1 - border]), axis=1
    )
    return shift, seen & inside & (np.abs(shift) < 0.9 * reach)
