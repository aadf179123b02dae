"""Explains holes in a depth image that are not due to objects too near to be measured.

A hole is explained by one of these:

- The sensor is blind there: a blank band along the image's border, or pixels that stayed blank
  while the camera moved so far that an object in front of it would have left them.
- The projector's light is blocked by something nearer, a shadow (see `projector_shadow`).
- The surface reflects too little, a dropout: the hole is surrounded by measured pixels, and is
  small, or stayed at the same place of the surface while the camera moved so far that the occlusion
  by a nearer object would have shifted.
"""

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform
from scipy.spatial import cKDTree

from pepper_drake.perception.cameras.camera import CameraIntrinsics, pixel_rays

Array = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
Points = npt.NDArray[np.floating]

_CELL = 6
"""Edge of the cells for which blindness is learned [pixels]."""
_THING_DEPTHS = (0.2, 0.3, 0.4)
"""Assumed depths of an object near the camera when views are compared [m]."""
_RING = 4
"""Width of the ring around a hole in which a surface is fitted [pixels]."""
_HOLE_WIDTH = 7
"""Edge of the square around a blank pixel in which no pixel measured anything [pixels]."""
_HOLE_EDGE = _HOLE_WIDTH - 1
"""Difference in width between a hole and its region of blank pixels [pixels]."""
_PLACE_STEP = 4
"""Stride of the tracked pixels of a closed hole along both axes."""


@dataclass(unsafe_hash=True)
class HoleParameters:
    """Parameters of explaining holes.

    Attributes:
        min_views: Smallest number of images in which a cell has to be blank to count as blind.
        widest_band: Widest blank band along the image's border, as a fraction of the image's width
            or height.
        smallest: Size of an object at the camera's near limit that is too small to matter [m].
        closed: Fraction of the ring around a hole that must be measured for a closed hole.
        flatness: Largest relative error of depth for a planar ring.
        same_place: Places on a surface closer to each other are the same [m].
        shadow_step: Smallest depth difference between a surface and the surface in its shadow [m].
        shadow_slack: Largest error of the pattern's displacement in a shadow [pixels].
        side_width: Width from which a row's shadow tells the projector's side [pixels].
        side_slack: Largest error of its width [pixels].
        side_rows: Number of such shadows from which the side can be told.
        side_ratio: How many times as many there must be on one side as on the other.
    """

    min_views: int = 3
    widest_band: float = 0.08
    smallest: float = 0.025
    closed: float = 0.85
    flatness: float = 0.03
    same_place: float = 0.04
    shadow_step: float = 0.04
    shadow_slack: float = 3.0
    side_width: float = 5.0
    side_slack: float = 2.0
    side_rows: int = 30
    side_ratio: float = 5.0


DEFAULT_HOLES = HoleParameters()
"""Default parameters."""


@dataclass(frozen=True, eq=False)
class HoleMemory:
    """Immutable memory of holes in earlier images.

    Attributes:
        measured: Pixels (height, width) that have measured something so far; (0, 0) at first.
        views: Number of images in which each cell (rows, columns) was blank although a surface was
            expected there.
        poses: (rows, columns, 12) the camera's orientation (row-major) and position [m] in the
            first of them.
        blind: Mask of blind cells (rows, columns).
        places: Dropouts (K, 3) on surfaces, in W [m].
        seen_from: The camera's position when each was first seen (K, 3), in W [m].
        settled: Mask of confirmed dropouts, a property of the surface (K,).
        shadows: Number of rows' shadows of a projector at positive and at negative x of the camera.
    """

    measured: Mask
    views: npt.NDArray[np.int16]
    poses: npt.NDArray[np.float32]
    blind: Mask
    places: npt.NDArray[np.float64]
    seen_from: npt.NDArray[np.float64]
    settled: Mask
    shadows: tuple[int, int] = (0, 0)

    @classmethod
    def empty(cls) -> "HoleMemory":
        """Returns the memory before the first image."""
        none = np.zeros((0, 0), dtype=bool)
        return cls(
            none,
            np.zeros((0, 0), np.int16),
            np.zeros((0, 0, 12), np.float32),
            none,
            np.zeros((0, 3)),
            np.zeros((0, 3)),
            np.zeros(0, dtype=bool),
        )

    def for_image_size(self, height: int, width: int) -> "HoleMemory":
        """Returns the memory itself, or an empty one if the images have another size."""
        if self.measured.shape == (height, width):
            return self
        rows, columns = -(-height // _CELL), -(-width // _CELL)
        return replace(
            HoleMemory.empty(),
            measured=np.zeros((height, width), dtype=bool),
            views=np.zeros((rows, columns), np.int16),
            poses=np.zeros((rows, columns, 12), np.float32),
            blind=np.zeros((rows, columns), dtype=bool),
        )

    def blind_pixels(self, parameters: HoleParameters = DEFAULT_HOLES) -> Mask:
        """Returns the mask of pixels (height, width) known to be blind."""
        height, width = self.measured.shape
        squares = np.repeat(np.repeat(self.blind, _CELL, 0), _CELL, 1)[:height, :width]
        return ~self.measured & (squares | border_band(self.measured, parameters))


def border_band(measured: Mask, parameters: HoleParameters = DEFAULT_HOLES) -> Mask:
    """Finds blank bands along an image's border.

    A band runs along most of a side. Its width is the 0.9 quantile of the lengths of the blank runs
    from the border inwards, without those longer than the widest band.

    Args:
        measured: Pixels (height, width) that measured something.
        parameters: The widest band.

    Returns:
        (height, width).
    """
    band = np.zeros(measured.shape, dtype=bool)
    for axis in (0, 1):
        for reverse in (False, True):
            side = measured if axis == 1 else measured.T
            side = side[:, ::-1] if reverse else side
            counted = side.any(axis=1)
            if np.count_nonzero(counted) < 0.25 * len(side):
                continue
            runs = np.argmax(side[counted], axis=1)
            widest = round(parameters.widest_band * side.shape[1])
            short = runs[runs <= widest]
            if np.count_nonzero(short > 0) < 0.5 * np.count_nonzero(counted):
                continue
            width = int(np.quantile(short, 0.9)) + 1
            view = band if axis == 1 else band.T
            view = view[:, ::-1] if reverse else view
            view[:, :width] = True
    return band


def blank_pixels(depth: Array, blind: Mask | None = None) -> Mask:
    """Finds pixels without any measurement in the 7x7 square around them.

    Args:
        depth: Depth image (height, width) [m], 0 for holes.
        blind: Mask of blind pixels, which do not count as holes; none if omitted.

    Returns:
        (height, width).
    """
    counted = depth > 0
    if blind is not None:
        counted = counted | blind
    square = np.ones((_HOLE_WIDTH, _HOLE_WIDTH), np.uint8)
    blank: Mask = cv2.dilate(counted.astype(np.uint8), square) == 0
    return blank


def learn_blindness(
    memory: HoleMemory,
    depth: Array,
    expected: tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]],
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    parameters: HoleParameters = DEFAULT_HOLES,
) -> HoleMemory:
    """Updates the memory with an image's holes where a surface is expected.

    An object that leaves the same pixels blank from two camera poses would have to move with the
    camera. So pixels are blind if, between the poses, an object in front of the camera moves
    farther in the image than the width of the blank region.

    Args:
        memory: The previous memory.
        depth: Depth image (height, width) [m], 0 for holes.
        expected: Columns and rows (N,) of pixels where a surface is expected.
        intrinsics: The camera.
        X_WC: Its pose.
        parameters: Parameters of blindness.
    """
    memory = memory.for_image_size(*depth.shape)
    measured = memory.measured | (depth > 0)
    shape = memory.views.shape
    has_measured = _any_in_cells(measured, shape)
    empty = ~_any_in_cells(depth > 0, shape)
    expected_cells = np.zeros(shape, dtype=bool)
    expected_cells[expected[1] // _CELL, expected[0] // _CELL] = True
    blank = expected_cells & ~has_measured
    first = blank & (memory.views == 0)
    views = np.where(has_measured, 0, memory.views + blank).astype(np.int16)
    poses = memory.poses
    if first.any():
        poses = poses.copy()
        now = np.concatenate((X_WC.rotation().matrix().ravel(), X_WC.translation()))
        poses[first] = now.astype(np.float32)
    blind = memory.blind & ~has_measured
    candidates = blank & ~blind & (views >= parameters.min_views)
    if candidates.any():
        regions, _, extents = _components(empty.astype(np.uint8))
        wide = _CELL * (extents[regions[candidates]] + 1)
        moved = _image_motion(np.argwhere(candidates), poses[candidates], intrinsics, X_WC)
        blind = blind.copy()
        blind[candidates] = moved > wide
    return replace(memory, measured=measured, views=views, poses=poses, blind=blind)


def _any_in_cells(pixels: Mask, shape: tuple[int, ...]) -> Mask:
    """Returns the mask of cells (rows, columns) in which any pixel is set."""
    rows, columns = shape
    padded = np.zeros((rows * _CELL, columns * _CELL), dtype=bool)
    padded[: pixels.shape[0], : pixels.shape[1]] = pixels
    return np.asarray(padded.reshape(rows, _CELL, columns, _CELL).any(axis=(1, 3)))


def _components(
    mask: npt.NDArray[np.uint8],
) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.int32], npt.NDArray[np.int32]]:
    """Returns labels, boxes (n, 4: left, top, width, height) and extents (n,) of regions."""
    _, labels, statistics, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    return labels, statistics[:, :4], statistics[:, 2:4].max(axis=1)


def _image_motion(
    cells: npt.NDArray[np.int64],
    poses: npt.NDArray[np.float32],
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
) -> npt.NDArray[np.float64]:
    """Returns the image motion (N,) [pixels] of objects at cells (N, 2) since earlier poses.

    It is the smallest over the possible depths of the object, infinite behind the camera.
    """
    pixels = cells[:, ::-1] * _CELL + 0.5 * _CELL
    focal = np.array([intrinsics.focal_x, intrinsics.focal_y])
    xy = (pixels - [intrinsics.center_x, intrinsics.center_y]) / focal
    rays = np.column_stack([xy, np.ones(len(xy))])
    R = poses[:, :9].reshape(-1, 3, 3).astype(float)
    least = np.full(len(cells), np.inf)
    for depth in _THING_DEPTHS:
        p_W = np.einsum("nij,nj->ni", R, depth * rays) + poses[:, 9:]
        p_C = (p_W - X_WC.translation()) @ X_WC.rotation().matrix()
        moved = np.linalg.norm(intrinsics.project(p_C) - pixels, axis=1)
        least = np.fmin(least, np.where(np.isfinite(moved), moved, np.inf))
    return least


def learn_dropouts(
    memory: HoleMemory,
    depth: Array,
    blank: Mask,
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    parameters: HoleParameters = DEFAULT_HOLES,
) -> tuple[HoleMemory, Mask]:
    """Updates the memory with an image's closed holes, and tells which are dropouts.

    Args:
        memory: The previous memory.
        depth: Depth image (height, width) [m], 0 for holes.
        blank: From `blank_pixels`.
        intrinsics: The camera.
        X_WC: Its pose.
        parameters: Parameters of dropouts.

    Returns:
        The memory, and the pixels (height, width) of holes that are explained.
    """
    explained = np.zeros(depth.shape, dtype=bool)
    labels, boxes, extents = _components(blank.astype(np.uint8))
    largest = parameters.smallest / intrinsics.near * max(intrinsics.focal_x, intrinsics.focal_y)
    p_WC = X_WC.translation()
    places, seen_from = [memory.places], [memory.seen_from]
    settled = [memory.settled]
    tree = cKDTree(memory.places) if len(memory.places) else None
    for label in range(1, len(boxes)):
        closed, p_C = _closed_hole(depth, labels == label, boxes[label], intrinsics, parameters)
        if not closed:
            continue
        # A region of blank pixels is narrower than its hole.
        if extents[label] + _HOLE_EDGE <= largest:
            explained[labels == label] = True
            continue
        if p_C is None:
            continue
        p_W = p_C @ X_WC.rotation().matrix().T + p_WC
        known = np.zeros(len(p_W), dtype=bool)
        if tree is not None:
            distance, index = tree.query(p_W, distance_upper_bound=parameters.same_place)
            known = np.isfinite(distance)
            old = np.asarray(index)[known]
            z = p_C[known, 2]
            # Shift on the surface of the occlusion by an object at the near limit.
            moved = np.linalg.norm(p_WC - memory.seen_from[old], axis=1)
            moved = moved * (z / intrinsics.near - 1.0)
            wide = (extents[label] + _HOLE_EDGE) / intrinsics.focal_x * z + parameters.same_place
            settled[0] = settled[0].copy()
            settled[0][old[moved > wide]] = True
            if np.count_nonzero(settled[0][old]) > 0.5 * len(p_W):
                explained[labels == label] = True
        new = p_W[~known]
        places.append(new)
        seen_from.append(np.broadcast_to(p_WC, new.shape))
        settled.append(np.zeros(len(new), dtype=bool))
    memory = replace(
        memory,
        places=np.concatenate(places),
        seen_from=np.concatenate(seen_from),
        settled=np.concatenate(settled),
    )
    return _measured_again(memory, depth, intrinsics, X_WC, parameters.same_place), explained


def _closed_hole(
    depth: Array,
    blank: Mask,
    box: npt.NDArray[np.int32],
    intrinsics: CameraIntrinsics,
    parameters: HoleParameters,
) -> tuple[bool, npt.NDArray[np.float64] | None]:
    """Examines the surroundings of a region of blank pixels.

    Args:
        depth: Depth image (height, width) [m], 0 for holes.
        blank: The region (height, width).
        box: Left, top, width and height of its box.
        intrinsics: The camera.
        parameters: Conditions for a closed hole and a planar ring.

    Returns:
        Whether the hole is closed, and if its ring is planar, points (M, 3) on that plane inside
        the hole in the camera frame [m], else None.
    """
    grown = _HOLE_EDGE // 2 + _RING
    left, top, right, bottom = box[0], box[1], box[0] + box[2], box[1] + box[3]
    height, width = depth.shape
    if left < grown or top < grown or right > width - grown or bottom > height - grown:
        return False, None
    rows = slice(top - grown, bottom + grown)
    columns = slice(left - grown, right + grown)
    region = blank[rows, columns].astype(np.uint8)
    hole = cv2.dilate(region, np.ones((_HOLE_EDGE + 1,) * 2, np.uint8))
    ring = cv2.dilate(hole, np.ones((2 * _RING + 1,) * 2, np.uint8)) > hole
    around = depth[rows, columns]
    counted = ring & (around > 0)
    if np.count_nonzero(counted) < parameters.closed * np.count_nonzero(ring):
        return False, None
    # On a plane, inverse depth is linear in the pixel's coordinates.
    v, u = np.nonzero(counted)
    terms = np.column_stack([u, v, np.ones(len(u))])
    inverse = 1.0 / around[counted].astype(float)
    plane = np.linalg.lstsq(terms, inverse, rcond=None)[0]
    flat = np.abs(terms @ plane - inverse) <= parameters.flatness * inverse
    if np.mean(flat) < parameters.closed:
        return True, None
    v, u = np.nonzero(region)
    chosen = (v % _PLACE_STEP == 0) & (u % _PLACE_STEP == 0)
    if not chosen.any():
        chosen = np.arange(len(v)) == len(v) // 2
    v, u = v[chosen], u[chosen]
    behind = np.column_stack([u, v, np.ones(len(u))]) @ plane
    if (behind <= 1.0 / intrinsics.far).any():
        return True, None
    rays = pixel_rays(intrinsics)[rows, columns][v, u].astype(float)
    return True, rays / behind[:, None]


def _measured_again(
    memory: HoleMemory,
    depth: Array,
    intrinsics: CameraIntrinsics,
    X_WC: RigidTransform,
    same_place: float,
) -> HoleMemory:
    """Removes the dropouts at which an image measures a surface, within `same_place` [m]."""
    p_C = (memory.places - X_WC.translation()) @ X_WC.rotation().matrix()
    ahead = np.flatnonzero((p_C[:, 2] > intrinsics.near) & intrinsics.sees(p_C))
    if not len(ahead):
        return memory
    columns, rows = np.rint(intrinsics.project(p_C[ahead])).astype(np.int64).T
    kept = np.ones(len(p_C), dtype=bool)
    kept[ahead] = np.abs(depth[rows, columns] - p_C[ahead, 2]) > same_place
    return replace(
        memory,
        places=memory.places[kept],
        seen_from=memory.seen_from[kept],
        settled=memory.settled[kept],
    )
