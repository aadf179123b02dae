"""Voxel map of the obstacles in the world frame, kept while the camera looks elsewhere.

Pepper's depth camera is blind below 0.4 m, and near a table its view is full of table and arm. So
depth images are accumulated in a map of voxels. A voxel has the mean of its points, their mean
normal, a score and the time when it was last hit. An image that sees through a voxel to something
farther away lowers its score, which removes objects that have left. Holes in the image change
nothing.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from scipy.spatial import cKDTree

from pepper_drake.compiled import compiled
from pepper_drake.errors import InputError
from pepper_drake.learning.dmp.point_cells import PointCells
from pepper_drake.perception.cameras.camera import CameraIntrinsics
from pepper_drake.perception.cameras.projection import pixel_at
from pepper_drake.perception.mapping.cloud import SurfacePoints
from pepper_drake.short_repr import figure_view, short_repr, short_signature

_KEY_BITS = 21
_KEY_OFFSET = 1 << (_KEY_BITS - 1)
_FINE_KEYS = 1 << (_KEY_BITS - 2)
"""Added to the keys of small voxels: half a million voxels upwards, where no large ones are."""
_LEAST_PIXELS = 4
"""Smallest number of measured pixels, of nine, for a voxel to be seen through."""


@dataclass(unsafe_hash=True)
class VoxelMapParameters:
    """Parameters of the voxel map.

    Attributes:
        voxel_size: Edge of a voxel [m].
        fine_radius: Distance from the goal object up to which voxels are half as large [m]. A
            voxel's mean lies in the middle of its points, at an edge of a thing inside it, so that
            a hand seems to be farther from the edge than it is.
        hit: Increase of a voxel's score by a frame with a point in it.
        miss: Decrease by a frame that sees through the voxel.
        doubt: Decrease by a frame that sees the voxel's surface, but no point in the voxel: removes
            voxels beside a surface that were filled by the noise of a few frames.
        max_score: Highest score: it determines how long a voxel outlives its object.
        carve_margin: A voxel is seen through when the depth there is larger by this [m] plus three
            standard deviations of the depth noise.
        depth_noise: Standard deviation of the depth at 1 m [m]; it grows with the square of depth.
        max_age: Voxels not hit for this long are forgotten [s]; by default no run is that long.
        max_distance: Voxels farther than this from the camera are forgotten [m].
        max_weight: Largest number of points that a voxel's mean weighs, so that it follows slow
            changes.
        settled_score: Score of voxels seen often enough to check images against.
        similar_distance: Views whose cameras are closer than this [m], ...
        similar_angle: ... and rotated by less than this [rad], are similar.
        max_similar_views: Number of similar views that are kept, ...
        max_views: ... and of all views; the oldest is dropped first.
    """

    __signature__ = short_signature

    voxel_size: float = 0.0125
    fine_radius: float = 0.25
    hit: int = 1
    miss: int = 2
    doubt: int = 1
    max_score: int = 3
    carve_margin: float = 0.012
    depth_noise: float = 0.002
    max_age: float = 1e6
    max_distance: float = 3.0
    max_weight: float = 40.0
    settled_score: int = 3
    similar_distance: float = 0.15
    similar_angle: float = 0.15
    max_similar_views: int = 3
    max_views: int = 32

    def __post_init__(self) -> None:
        if not self.voxel_size > 0:
            raise InputError(f"voxel_size {self.voxel_size} must be positive.")


@dataclass(frozen=True)
class VoxelMap:
    """Occupied voxels, sorted by key; immutable: updates return new maps.

    Attributes:
        keys: (N,) int64, the voxel's cell in the world's grid.
        positions: (N, 3) float32, mean of its points in W [m].
        normals: (N, 3) float32, sum of its points' normals, not normalised; zero if unknown.
        weights: (N,) float32, number of points in the mean.
        scores: (N,) int16, hits minus misses; all positive.
        hit_times: (N,) time of the last hit [s].
    """

    keys: "npt.NDArray[np.int64]"
    positions: "npt.NDArray[np.float32]"
    normals: "npt.NDArray[np.float32]"
    weights: "npt.NDArray[np.float32]"
    scores: "npt.NDArray[np.int16]"
    hit_times: "npt.NDArray[np.float64]"

    __repr__ = short_repr
    _repr_html_ = figure_view

    @classmethod
    def empty(cls) -> "VoxelMap":
        """Returns an empty map."""
        return cls(
            np.zeros(0, np.int64),
            np.zeros((0, 3), np.float32),
            np.zeros((0, 3), np.float32),
            np.zeros(0, np.float32),
            np.zeros(0, np.int16),
            np.zeros(0),
        )

    def __len__(self) -> int:
        return len(self.keys)

    def __deepcopy__(self, memo: dict) -> "VoxelMap":
        """Returns itself: Drake copies the state at each event, and a map never changes."""
        return self

    @cached_property
    def tree(self) -> cKDTree:
        """Returns a k-d tree of the positions."""
        return cKDTree(self.positions, balanced_tree=False, compact_nodes=False)

    @cached_property
    def cells(self) -> PointCells:
        """Returns the positions sorted into cells, which is faster than a tree."""
        return PointCells.of(self.positions.astype(float))

    def select(self, kept: npt.NDArray[np.bool_]) -> "VoxelMap":
        """Returns the map of the voxels selected by a mask (N,)."""
        if kept.all():
            return self
        return VoxelMap(
            self.keys[kept],
            self.positions[kept],
            self.normals[kept],
            self.weights[kept],
            self.scores[kept],
            self.hit_times[kept],
        )

    def surface(self) -> SurfacePoints:
        """Returns one point and unit normal for each voxel; normals are NaN where unknown."""
        length = np.linalg.norm(self.normals, axis=1, keepdims=True)
        unit = np.divide(
            self.normals, length, out=np.full_like(self.normals, np.nan), where=length > 0
        )
        return SurfacePoints(self.positions, unit)


def voxel_keys(positions: npt.NDArray[np.floating], voxel_size: float) -> npt.NDArray[np.int64]:
    """Returns the key of each point's (N, 3) voxel.

    Keys of points beyond about a million voxels from the origin are not unique.
    """
    cells = np.floor(positions * (1.0 / voxel_size)).astype(np.int64) + _KEY_OFFSET
    return (cells[:, 0] << 2 * _KEY_BITS) | (cells[:, 1] << _KEY_BITS) | cells[:, 2]


def one_per_voxel(positions: npt.NDArray[np.floating], voxel_size: float) -> npt.NDArray[np.int64]:
    """Returns the index of one point (N, 3) of each voxel of that size [m] with any."""
    return np.asarray(np.unique(voxel_keys(positions, voxel_size), return_index=True)[1])


def _graded_keys(
    positions: npt.NDArray[np.floating],
    p_WO: npt.NDArray[np.floating] | None,
    parameters: VoxelMapParameters,
) -> npt.NDArray[np.int64]:
    """Returns the key of each point's (N, 3) voxel, which near the goal object is a small one.

    When the object moves, voxels of the wrong size are no longer hit, and disappear when seen.
    """
    keys = voxel_keys(positions, parameters.voxel_size)
    if p_WO is not None:
        offset = positions - p_WO.astype(positions.dtype)
        near = np.einsum("ij,ij->i", offset, offset) < parameters.fine_radius**2
        keys[near] = voxel_keys(positions[near], 0.5 * parameters.voxel_size) + _FINE_KEYS
    return keys


def add_points(
    voxels: VoxelMap,
    surface: SurfacePoints,
    time: float,
    parameters: VoxelMapParameters,
    p_WO: npt.NDArray[np.floating] | None = None,
) -> VoxelMap:
    """Adds one frame's points; each voxel with any is hit once.

    Args:
        voxels: The map.
        surface: The frame's points.
        time: Capture time of the frame [s].
        parameters: Voxel sizes and scores.
        p_WO: The goal object's position (3,) [m]; None if unknown.
    """
    if len(surface.positions) == 0:
        return voxels
    keys, cell = np.unique(_graded_keys(surface.positions, p_WO, parameters), return_inverse=True)
    count = len(keys)
    weight = np.bincount(cell, minlength=count)
    normals = np.nan_to_num(surface.normals, nan=0.0)
    position_sum = np.stack(
        [np.bincount(cell, surface.positions[:, k], count) for k in range(3)], axis=1
    )
    normal_sum = np.stack([np.bincount(cell, normals[:, k], count) for k in range(3)], axis=1)

    place = np.searchsorted(voxels.keys, keys)
    known = np.zeros(count, dtype=bool)
    inside = place < len(voxels)
    known[inside] = voxels.keys[place[inside]] == keys[inside]
    old = place[known]

    positions, all_normals = voxels.positions.copy(), voxels.normals.copy()
    weights, scores, times = voxels.weights.copy(), voxels.scores.copy(), voxels.hit_times.copy()
    total = weights[old] + weight[known]
    positions[old] = (positions[old] * weights[old, None] + position_sum[known]) / total[:, None]
    fading = np.minimum(1.0, parameters.max_weight / total)
    all_normals[old] = (all_normals[old] + normal_sum[known]) * fading[:, None]
    weights[old] = total * fading
    scores[old] = np.minimum(scores[old] + parameters.hit, parameters.max_score)
    times[old] = time

    new = ~known
    at = place[new]
    return VoxelMap(
        np.insert(voxels.keys, at, keys[new]),
        np.insert(positions, at, position_sum[new] / weight[new, None], axis=0),
        np.insert(all_normals, at, normal_sum[new], axis=0),
        np.insert(weights, at, weight[new]),
        np.insert(scores, at, parameters.hit),
        np.insert(times, at, time),
    )


def sees_free_space(
    p_W: npt.NDArray[np.floating],
    depth: npt.NDArray[np.float32],
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    parameters: VoxelMapParameters,
) -> npt.NDArray[np.bool_]:
    """Tells which places an image sees as free.

    All depths measured by the nine pixels around a place's projection, at least four of them, are
    clearly larger than the place's.

    Args:
        p_W: The places (N, 3) [m].
        depth: Depth image (height, width) [m], 0 for holes.
        intrinsics: The camera.
        X_WC: Its pose when the image was taken.
        parameters: Margins.

    Returns:
        (N,).
    """
    return is_free_space(p_W, minimum_depth(depth, intrinsics), intrinsics, X_WC, parameters)


def minimum_depth(
    depth: npt.NDArray[np.float32], intrinsics: CameraIntrinsics, width: int = 3
) -> npt.NDArray[np.float32]:
    """Returns the smallest depth around each pixel [m]; 0 where too little was measured.

    Args:
        depth: Depth image (height, width) [m], 0 for holes.
        intrinsics: The camera.
        width: Edge of the square around a pixel, an odd number.
    """
    if depth.size == 0:
        return depth
    measured = depth > 0
    count = cv2.boxFilter(measured.astype(np.uint8), -1, (3, 3), normalize=False)
    distant = np.where(measured, depth, np.float32(2 * intrinsics.far))
    nearest = cv2.erode(distant, np.ones((width, width), np.uint8))
    return np.where(count >= _LEAST_PIXELS, nearest, np.float32(0.0))


def is_free_space(
    p_W: npt.NDArray[np.floating],
    clear: npt.NDArray[np.float32],
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    parameters: VoxelMapParameters,
) -> npt.NDArray[np.bool_]:
    """Tells which places (N, 3) an image sees as free, given its `minimum_depth`."""
    if len(p_W) == 0 or clear.size == 0:
        return np.zeros(len(p_W), dtype=bool)
    number: Any = p_W.dtype.type
    return np.asarray(
        _sees_through(
            np.array(p_W),
            clear,
            intrinsics.numbers,
            X_WC.GetAsMatrix34().astype(number),
            number(parameters.carve_margin),
            number(3 * parameters.depth_noise),
        )
    )


@compiled
def _sees_through(
    p_W: npt.NDArray[np.floating],
    clear: npt.NDArray[np.float32],
    camera: npt.NDArray[np.float64],
    X_WC: npt.NDArray[np.floating],
    margin: float,
    noise: float,
) -> npt.NDArray[np.bool_]:
    """Computes `is_free_space` place by place."""
    through = np.zeros(len(p_W), dtype=np.bool_)
    height, width = clear.shape
    for n in range(len(p_W)):
        a, b, c = p_W[n, 0] - X_WC[0, 3], p_W[n, 1] - X_WC[1, 3], p_W[n, 2] - X_WC[2, 3]
        z = a * X_WC[0, 2] + b * X_WC[1, 2] + c * X_WC[2, 2]
        if not z > 0.05:
            continue
        x = np.float64(a * X_WC[0, 0] + b * X_WC[1, 0] + c * X_WC[2, 0]) / np.float64(z)
        y = np.float64(a * X_WC[0, 1] + b * X_WC[1, 1] + c * X_WC[2, 1]) / np.float64(z)
        u, v = pixel_at(x, y, camera)
        if u >= -0.5 and v >= -0.5 and u < width - 0.5 and v < height - 0.5:
            seen = clear[int(np.rint(v)), int(np.rint(u))]
            through[n] = seen - (margin + noise * (z * z)) > z
    return through


def carve_free_space(
    voxels: VoxelMap,
    depth: npt.NDArray[np.float32],
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    time: float,
    parameters: VoxelMapParameters,
    spared: npt.NDArray[np.bool_] | None = None,
) -> VoxelMap:
    """Lowers the score of every voxel that the camera sees through, or no longer sees filled.

    A voxel is seen through when all depths measured by the nine pixels around its projection, at
    least four of them, are clearly larger. Voxels hit at `time` are unchanged.

    Args:
        voxels: The map.
        depth: Depth image (height, width) [m], 0 for holes.
        intrinsics: The camera.
        X_WC: Its pose when the image was taken.
        time: Capture time of the image [s].
        parameters: Scores and margins.
        spared: Mask of voxels (N,) in excluded solids, for which missing points mean nothing.

    Returns:
        The map of voxels whose score is still positive.
    """
    if len(voxels) == 0 or depth.size == 0:
        return voxels
    R_WC = X_WC.rotation().matrix().astype(np.float32)
    p_C = (voxels.positions - X_WC.translation().astype(np.float32)) @ R_WC
    z = p_C[:, 2]
    ahead = np.flatnonzero((z > 0.05) & (voxels.hit_times < time))
    uv = np.rint(intrinsics.project(p_C[ahead])).astype(np.int64)
    inside = np.all((uv >= 0) & (uv < [intrinsics.width, intrinsics.height]), axis=1)
    ahead, uv = ahead[inside], uv[inside]
    rows, columns = uv[:, 1], uv[:, 0]
    clear = minimum_depth(depth, intrinsics)[rows, columns]
    margin = parameters.carve_margin + 3 * parameters.depth_noise * np.square(z[ahead])
    scores = voxels.scores.copy()
    scores[ahead[clear - margin > z[ahead]]] -= parameters.miss
    unfilled = np.abs(depth[rows, columns] - z[ahead]) <= margin
    if spared is not None:
        unfilled &= ~spared[ahead]
    scores[ahead[unfilled]] -= parameters.doubt
    return replace(voxels, scores=scores).select(scores > 0)


def prune(
    voxels: VoxelMap,
    p_WC: npt.NDArray[np.float64],
    time: float,
    parameters: VoxelMapParameters,
) -> VoxelMap:
    """Drops voxels that were not hit for too long or are too far from the camera at p_WC (3,)."""
    if len(voxels) == 0:
        return voxels
    offset = voxels.positions - p_WC.astype(np.float32)
    near = np.einsum("ij,ij->i", offset, offset) <= parameters.max_distance**2
    return voxels.select(near & (time - voxels.hit_times <= parameters.max_age))
