"""Refines a marker's pose on all black-white edges of its pattern, not only on its four sides.

The corners of a marker 1 m away are measured to a tenth of a pixel, which is several millimetres of
depth. Its pattern has many more edges. Each is searched for along the normal of its predicted
position, and the pose is fitted to all of them by Gauss-Newton steps, as in model-based tracking
(Drummond and Cipolla 2002, doi:10.1109/TPAMI.2002.1017620).
"""

import functools
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix

from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.goal.marker_params import DEFAULT_MARKER, EdgeParams

Array = npt.NDArray[np.float64]

_SAMPLES = 4
"""Samples along one module's edge."""

_OFFSETS = np.linspace(-1, 1, 11)
"""Image samples along the normal, relative to the search range."""


_WORST_CONDITION = 1e12
"""Largest condition number of the normal equations in rad and m; a marker 1 m away has 1e7."""


@dataclass(frozen=True)
class MarkerEdges:
    """The black-white edges of a marker's pattern, sampled.

    Attributes:
        points: (N, 2) on the edges, in sides of the black square, origin at its centre, y up.
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
        error: Root mean square reprojection error of the edges [pixels].
        support: Fraction of the pattern's edges that were seen.
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
    params: EdgeParams = DEFAULT_MARKER.edges,
) -> EdgeFit | None:
    """Fits a marker's pose to the edges of its pattern in an image.

    Args:
        gray: The image (height, width).
        X_CM: Initial pose, correct to about a pixel.
        edges: The pattern's edges.
        size: Side of the black square [m].
        intrinsics: The camera.
        iterations: Gauss-Newton steps.
        params: Search for the edges, and their errors.

    Returns:
        The fit; None if too few edges are seen.
    """
    fit = _fit(gray, X_CM, edges, size, intrinsics, iterations, params, offset=None)
    if fit is None or abs(fit[1]) < params.min_exposure_offset:
        return None if fit is None else fit[0]
    # Overexposure widens white areas: all edges are shifted.
    again = _fit(gray, fit[0].X_CM, edges, size, intrinsics, iterations, params, offset=fit[1])
    return fit[0] if again is None else again[0]


def _fit(
    gray: npt.NDArray[np.uint8],
    X_CM: RigidTransform,
    edges: MarkerEdges,
    size: float,
    intrinsics: CameraIntrinsics,
    iterations: int,
    params: EdgeParams,
    *,
    offset: float | None,
) -> tuple[EdgeFit, float] | None:
    """Fits the pose, and if given, a common offset of all edges towards white [pixels], too.

    Returns:
        The fit, and the offset, estimated from the residuals if it was not fitted. None if too few
        edges are seen.
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
        # Image of a hundredth of the marker's side along the normal.
        ahead = p_C + (0.01 * size) * (normals @ R.T)
        both = intrinsics.project(np.concatenate([p_C, ahead]))
        place = both[: len(p_C)]
        direction = both[len(p_C) :] - place
        length = np.hypot(direction[:, 0], direction[:, 1])
        direction /= length[:, None]
        reach = np.minimum(
            params.search_ratio * 100 / edges.modules * length, params.longest_search
        )
        if reach.min() < params.shortest_search:
            return None
        shift, seen, width = _find_edges(
            gray, place + shifted * direction, direction, reach, params
        )
        if np.count_nonzero(seen) < params.min_edges * _SAMPLES:
            return None
        J = np.column_stack(
            [_jacobian(arm[seen], p_C[seen], direction[seen], intrinsics), np.ones(seen.sum())]
        )
        r = shift[seen]
        weight = np.minimum(1.0, params.outlier / np.maximum(np.abs(r), 1e-9))
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
    blur_variance = float(np.average((params.neighbours / module**2) ** 2, weights=weight))
    # The samples of one edge are fully correlated.
    variance = float(max(error, params.min_error) ** 2 + blur_variance) * _SAMPLES
    pose = RigidTransform(rotation, translation)
    covariance = np.asarray(variance * inverse[:6, :6], dtype=float)
    # A common shift of all edges inwards or outwards appears as another distance.
    width_share = width * float(np.mean(reach[seen] / module))
    blurred = params.blurred * np.exp((width_share - params.blurred_width) / params.blurred_growth)
    spill = params.spill * shifted / float(np.mean(module))
    along = float(np.hypot(blurred, spill)) / (100 * float(np.mean(length))) * translation
    covariance[3:, 3:] += np.outer(along, along)
    if offset is None:
        shifted = float(np.linalg.lstsq(whole, J.T @ (weight * r), rcond=None)[0][6])
    return EdgeFit(pose, error, float(np.mean(seen)), covariance), shifted


def _jacobian(arm: Array, p_C: Array, direction: Array, intrinsics: CameraIntrinsics) -> Array:
    """Returns the Jacobian of points along image directions w.r.t. the marker's pose.

    Args:
        arm: Points from the marker's origin (N, 3), axes of C.
        p_C: Points in the camera frame (N, 3).
        direction: Image directions (N, 2).
        intrinsics: The camera; the gradient of its distortion is neglected.

    Returns:
        (N, 6), pixels per rad about C's axes and per m along them.
    """
    scaled = direction * np.array([intrinsics.focal_x, intrinsics.focal_y]) / p_C[:, 2:]
    x, y, z = arm.T
    u, v = scaled.T
    w = -(u * p_C[:, 0] + v * p_C[:, 1]) / p_C[:, 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u, u, v, w], axis=1)


def _find_edges(
    gray: npt.NDArray[np.uint8],
    places: Array,
    direction: Array,
    reach: Array,
    params: EdgeParams,
) -> tuple[Array, npt.NDArray[np.bool_], float]:
    """Finds edges near predicted positions.

    Args:
        gray: The image.
        places: Predicted pixel coordinates (N, 2).
        direction: Image directions (N, 2) from dark to bright.
        reach: Search range to either side (N,) [pixels].
        params: Contrast of an edge.

    Returns:
        Shift of each edge along its direction (N,) [pixels], which of them were seen (N,), and the
        width (standard deviation) of the edges' slope, relative to the search range.
    """
    steps = reach[:, None] * _OFFSETS
    at = (places[:, None] + steps[..., None] * direction[:, None]).astype(np.float32)
    profile = cv2.remap(
        gray, at[..., 0], at[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    ).astype(float)
    dark, bright = profile[:, :2].mean(axis=1), profile[:, -2:].mean(axis=1)
    contrast = bright - dark
    median_contrast = np.median(contrast)
    seen = contrast > max(params.min_contrast * median_contrast, params.min_step)
    # Position of an ideal step from dark to bright with the same integral over the range.
    fill = np.mean((profile - dark[:, None]), axis=1) / np.where(seen, contrast, 1.0)
    shift = reach * (1 - 2 * fill)
    height, width = gray.shape
    border = params.longest_search
    inside = np.all(
        (places > border) & (places < [width - 1 - border, height - 1 - border]), axis=1
    )
    seen &= inside & (np.abs(shift) < params.found_fraction * reach)
    step = (profile[seen] - dark[seen, None]) / contrast[seen, None]
    return shift, seen, _width(step.mean(axis=0)) if seen.any() else 0.0


def _width(profile: Array) -> float:
    """Returns the standard deviation of a step's slope, relative to the search range."""
    slope = np.maximum(np.diff(profile), 1e-6)
    middles = (_OFFSETS[1:] + _OFFSETS[:-1]) / 2
    return float(np.sqrt(np.cov(middles, aweights=slope, ddof=0)))
