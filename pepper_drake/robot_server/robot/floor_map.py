"""A map of the floor from the base's lasers: an occupancy grid, with localization and planning.

The grid holds log-odds (Elfes 1989; Thrun et al., Probabilistic Robotics, chapter 9), exploration
uses frontiers (Yamauchi 1997), and a pose is matched to the map by its likelihood field (Thrun et
al., chapter 6.4). The map's frame M is the base's at the start of the exploration.
"""

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy import ndimage, optimize, sparse, spatial
from scipy.sparse import csgraph

from pepper_drake.array_files import read_npz
from pepper_drake.errors import InputError
from pepper_drake.files import write_atomically

Vector = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Cells = npt.NDArray[np.int64]
Pose = Sequence[float] | Vector

CELL = 0.1
"""Edge of a cell [m]."""
EXTENT = 50.0
"""Largest extent of a map from M's origin along each axis [m]."""
_HIT, _FREE, _MOST = 1.5, -0.4, 5.0
"""Log-odds that a ray adds to its last cell and to the cells it passes, and their limit."""
_RADIUS = 0.28
"""Radius of the base [m]."""
_CLEARANCE = _RADIUS + math.sqrt(0.5) * CELL + 0.5 * CELL
"""Distance that the base's centre keeps from the centre of an occupied cell [m]: the obstacle may
be half a diagonal nearer, and the pose is known to half a cell."""
_MARGIN = 3
"""Margin of unknown cells around the known ones."""
_LARGEST = 2 * round(EXTENT / CELL) + 2 * _MARGIN + 1
"""Largest number of rows or columns of a map."""
_FARTHEST = 0.6
"""Largest distance of a hit from an occupied cell that counts for the pose [m]."""
_FEWEST_HITS = 3
_STEPS = np.diag([CELL / 4, CELL / 4, 0.01])
"""Steps of the finite differences by the pose [m, rad]."""
_SMALLEST_FRONTIER = 3
"""Least number of cells; smaller frontiers are gaps between two rays."""
_ELSEWHERE = 3 * CELL
"""Places nearer than this to a visited one offer no new view [m]."""
_AROUND = np.indices((11, 11)).reshape(2, -1).T - 5
"""Offsets of the cells that may be within `_CLEARANCE` of a cell."""


@dataclass(frozen=True)
class LaserScan:
    """One scan in the base's frame.

    Attributes:
        starts: Start points of the rays (N, 2) [m].
        ends: End points (N, 2) [m].
        hits: Whether each ray hit something (N,).
    """

    starts: Vector
    ends: Vector
    hits: Mask


@dataclass(frozen=True)
class FloorMap:
    """The grid. It is immutable, so that threads may share it: a scan makes a new one.

    Attributes:
        log_odds: Of occupancy (rows, columns), rows along y, columns along x.
        origin: Lower left corner of the grid, x and y in M [m].
    """

    log_odds: Vector = field(default_factory=lambda: np.zeros((1, 1)))
    origin: Vector = field(default_factory=lambda: np.zeros(2))

    @cached_property
    def is_occupied(self) -> Mask:
        """Occupied cells (rows, columns), with positive log-odds."""
        occupied: Mask = self.log_odds > 0.0
        return occupied

    @cached_property
    def is_free(self) -> Mask:
        """Cells (rows, columns) known to be free; cells neither free nor occupied are unknown."""
        free: Mask = self.log_odds < 0.5 * _FREE
        return free

    @cached_property
    def _distance(self) -> Vector:
        """Distance of each cell from the nearest occupied one [m]."""
        if not self.is_occupied.any():
            return np.full(self.log_odds.shape, np.inf)
        return np.asarray(CELL * ndimage.distance_transform_edt(~self.is_occupied))

    def with_scan(self, scan: LaserScan, pose: Pose) -> "FloorMap":
        """Returns the map updated with a scan from the base's pose in M.

        Points beyond `EXTENT` are left out.

        Args:
            scan: The scan.
            pose: x, y, theta [m, rad].
        """
        starts, ends = transformed(pose, scan.starts), transformed(pose, scan.ends)
        grown = self._grown(np.vstack((starts, ends)))
        length = float(np.linalg.norm(ends - starts, axis=1).max())
        shares = np.linspace(0.0, 1.0, int(2 * length / CELL) + 2)[:, None, None]
        passed = grown._cells((starts + shares * (ends - starts)).reshape(-1, 2))
        ended = grown._cells(ends[scan.hits])
        # Each cell counts once per scan; a cell with a ray's end is not passed.
        free = np.unique(grown._inside(passed), axis=0)
        grown.log_odds[free[:, 0], free[:, 1]] += _FREE
        hit = np.unique(grown._inside(ended), axis=0)
        grown.log_odds[hit[:, 0], hit[:, 1]] += _HIT - _FREE
        np.clip(grown.log_odds, -_MOST, _MOST, out=grown.log_odds)
        return grown

    def percent(self) -> npt.NDArray[np.int64]:
        """Returns occupancy probabilities from 0 to 100, the top row first; 50 is unknown."""
        return np.rint(100.0 / (1.0 + np.exp(-self.log_odds[::-1]))).astype(np.int64)

    def matched(self, scan: LaserScan, pose: Pose) -> tuple[Vector, float]:
        """Returns the pose near a guess at which a scan's hits match the map best.

        Args:
            scan: The scan.
            pose: The guess: x, y, theta [m, rad].

        Returns:
            The pose, and the hits' mean distance there from occupied cells, each limited to 0.6 m
            [m]; infinite if the scan or the map has too little data.
        """
        hits = scan.ends[scan.hits]
        if not self.is_occupied.any() or len(hits) < _FEWEST_HITS:
            return np.array(pose, dtype=float), np.inf
        distance = np.minimum(self._distance, _FARTHEST)

        def residuals(guess: Vector) -> Vector:
            return self._at(distance, transformed(guess, hits), _FARTHEST)

        def jacobian(guess: Vector) -> Vector:
            slopes = [
                (residuals(guess + step) - residuals(guess - step)) / (2 * step.sum())
                for step in _STEPS
            ]
            return np.stack(slopes, axis=1)

        found = optimize.least_squares(
            residuals, np.array(pose, dtype=float), jacobian, loss="soft_l1", f_scale=CELL
        )
        return np.asarray(found.x), float(residuals(found.x).mean())

    def contains(self, place: Pose) -> bool:
        """Returns whether a position x, y in M [m] is on the grid."""
        return bool(len(self._inside(self._cells(np.array([place[:2]], dtype=float)))))

    def path(self, start: Pose, goal: Pose) -> list[Vector] | None:
        """Returns waypoints (2,) in M of a path through known free space, or None."""
        if not (self.contains(start) and self.contains(goal)):
            return None
        free = self._drivable(start)
        place = np.array(goal[:2], dtype=float)
        target = self._cells(place[None])[0]
        if not free[tuple(target)] or not self._sees(free, self._centres(target[None])[0], place):
            return None
        predecessors, cost, number_of = self._search(free, start)
        if not np.isfinite(cost[number_of[tuple(target)]]):
            return None
        return self._traced(free, predecessors, number_of, target, start, place)

    def leads_straight(self, start: Pose, end: Pose) -> bool:
        """Returns whether the straight line between two positions is known to be free."""
        if not (self.contains(start) and self.contains(end)):
            return False
        points = np.array([start[:2], end[:2]], dtype=float)
        return self._sees(self._drivable(start), points[0], points[1])

    def frontier(
        self, start: Pose, radius: float, looked_from: Sequence[Vector]
    ) -> list[Vector] | None:
        """Returns the path to the nearest place that offers a new view, or None.

        Args:
            start: Position of the base, x, y in M [m].
            radius: Largest distance of the place from M's origin [m].
            looked_from: Visited places (2,) in M [m].
        """
        if not self.contains(start):
            return None
        free = self._drivable(start)
        edge = self.is_free & ndimage.binary_dilation(~(self.is_free | self.is_occupied))
        labels, number = ndimage.label(edge, np.ones((3, 3)))
        sizes = ndimage.sum_labels(edge, labels, np.arange(number + 1))
        edge &= sizes[labels] >= _SMALLEST_FRONTIER
        # Cells from which the base sees the frontier.
        reach = int(np.ceil((_CLEARANCE + 2 * CELL) / CELL))
        wanted = np.argwhere(free & ndimage.binary_dilation(edge, iterations=reach))
        centres = self._centres(wanted)
        is_wanted = np.linalg.norm(centres, axis=1) <= radius
        if looked_from:
            is_wanted &= spatial.KDTree(looked_from).query(centres)[0] > _ELSEWHERE
        wanted = wanted[is_wanted]
        if not len(wanted):
            return None
        predecessors, cost, number_of = self._search(free, start)
        costs = cost[number_of[wanted[:, 0], wanted[:, 1]]]
        best = int(np.argmin(costs))
        if not np.isfinite(costs[best]):
            return None
        end = self._centres(wanted[best][None])[0]
        return self._traced(free, predecessors, number_of, wanted[best], start, end)

    @cached_property
    def _has_room(self) -> Mask:
        """Free cells with enough clearance."""
        return self.is_free & (self._distance > _CLEARANCE)

    def _drivable(self, start: Pose) -> Mask:
        """Cells that the base may drive over: those with clearance, and those that lead there.

        If the base stands too close to something, it may drive on as long as it gets no closer.
        """
        free = self._has_room.copy()
        place = np.array(start[:2], dtype=float)
        here = self._cells(place[None])[0]
        around = self._inside(here + _AROUND)
        away = np.linalg.norm(self._centres(around) - place, axis=1)
        rows, columns = around[away < _CLEARANCE].T
        is_free = self.is_free[rows, columns] | (away[away < _CLEARANCE] < _RADIUS)
        is_no_nearer = self._distance[rows, columns] >= self._distance[tuple(here)]
        free[rows, columns] |= is_free & is_no_nearer
        return free

    def _search(self, free: Mask, start: Pose) -> tuple[npt.NDArray[np.int32], Vector, Cells]:
        """Dijkstra's search on the 8-connected grid of free cells."""
        number_of = np.cumsum(free).reshape(free.shape) - 1
        rows, columns, costs = [], [], []
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            here = free[: free.shape[0] - dy, max(-dx, 0) : free.shape[1] - max(dx, 0)]
            there = free[dy:, max(dx, 0) : free.shape[1] + min(dx, 0)]
            both = here & there
            if dy and dx:  # No diagonal past a corner.
                both &= free[:-1, 1:] & free[1:, :-1] if dx > 0 else free[:-1, :-1] & free[1:, 1:]
            ours = number_of[: free.shape[0] - dy, max(-dx, 0) : free.shape[1] - max(dx, 0)]
            theirs = number_of[dy:, max(dx, 0) : free.shape[1] + min(dx, 0)]
            rows.append(ours[both])
            columns.append(theirs[both])
            costs.append(np.full(int(both.sum()), np.hypot(dx, dy)))
        size = int(free.sum())
        entries = np.concatenate(costs), (np.concatenate(rows), np.concatenate(columns))
        graph = sparse.csr_matrix(entries, shape=(size, size))
        first = number_of[tuple(self._cells(np.array([start[:2]]))[0])]
        cost, predecessors = csgraph.dijkstra(
            graph, directed=False, indices=first, return_predecessors=True
        )
        return predecessors, cost, number_of

    def _traced(
        self,
        free: Mask,
        predecessors: npt.NDArray[np.int32],
        number_of: Cells,
        target: Cells,
        start: Pose,
        end: Vector,
    ) -> list[Vector]:
        """Returns the path to an end in the target cell, without needless waypoints."""
        cells = np.argwhere(free)
        numbers = [int(number_of[tuple(target)])]
        while predecessors[numbers[-1]] >= 0:
            numbers.append(int(predecessors[numbers[-1]]))
        between = self._centres(cells[numbers[:0:-1]])
        points = [np.array(start[:2], dtype=float), *between, end]
        kept, last = [], 0
        while last < len(points) - 1:
            ahead = range(len(points) - 1, last, -1)
            last = next((k for k in ahead if self._sees(free, points[last], points[k])), last + 1)
            kept.append(points[last])
        return kept

    def _sees(self, free: Mask, start: Vector, end: Vector) -> bool:
        """Returns whether a line is free with enough clearance, or at least its start's."""
        shares = np.linspace(0.0, 1.0, int(4 * np.linalg.norm(end - start) / CELL) + 2)
        points = start + shares[:, None] * (end - start)
        cells = self._cells(points)
        room = self._at(np.minimum(self._distance, 1.0), points, 0.0)
        is_clear = room >= min(_CLEARANCE, room[0])
        return bool((is_clear & free[cells[:, 0], cells[:, 1]]).all())

    def _at(self, values: Vector, points: Vector, outside: float) -> Vector:
        """Interpolates values of cells' centres (rows, columns) at points (N, 2) in M."""
        cells = (points - self.origin) / CELL - 0.5
        found = ndimage.map_coordinates(
            values, cells[:, ::-1].T, order=1, mode="constant", cval=outside
        )
        return np.asarray(found)

    def _cells(self, points: Vector) -> Cells:
        cells = np.floor((points - self.origin) / CELL)[:, ::-1]
        return np.clip(cells, -(2.0**31), 2.0**31).astype(np.int64)

    def _centres(self, cells: Cells) -> Vector:
        return self.origin + CELL * (cells[:, ::-1] + 0.5)

    def _inside(self, cells: Cells) -> Cells:
        """Returns those of some cells (N, 2) that are on the grid."""
        return cells[((cells >= 0) & (cells < self.log_odds.shape)).all(axis=1)]

    def _grown(self, points: Vector) -> "FloorMap":
        """Returns a copy with space for points; it stays square, as client programs expect."""
        cells = self._cells(points[np.abs(points).max(axis=1) <= EXTENT])
        rows, columns = self.log_odds.shape
        inside = (cells >= _MARGIN) & (cells < np.array([rows, columns]) - _MARGIN)
        if inside.all():
            return FloorMap(self.log_odds.copy(), self.origin)
        least = np.minimum(cells.min(axis=0) - _MARGIN, 0)
        most = np.maximum(cells.max(axis=0) + _MARGIN + 1, (rows, columns))
        size = int((most - least).max())
        grown = np.zeros((size, size))
        y, x = -least
        grown[y : y + rows, x : x + columns] = self.log_odds
        return FloorMap(grown, self.origin + CELL * least[::-1])


def write_floor_map(known: FloorMap, path: Path) -> None:
    """Writes a map atomically.

    Raises:
        InputError: The folder cannot be written to.
    """
    content = io.BytesIO()
    np.savez_compressed(content, log_odds=known.log_odds, origin=known.origin)
    write_atomically(path, content.getvalue())


def read_floor_map(path: Path) -> FloorMap:
    """Reads a map from `write_floor_map`.

    Raises:
        InputError: There is no such file, or it holds no map.
    """
    arrays = read_npz(path, ("log_odds", "origin"), kinds="f")
    for name in ("log_odds", "origin"):
        if name not in arrays:
            raise InputError(f"{path}: has no {name}")
    log_odds, origin = (arrays[name].astype(np.float64) for name in ("log_odds", "origin"))
    if log_odds.ndim != 2 or not all(1 <= size <= _LARGEST for size in log_odds.shape):
        raise InputError(
            f"{path}: log_odds must be a grid of 1 to {_LARGEST} rows and columns, "
            f"not of the shape {log_odds.shape}"
        )
    if not np.isfinite(log_odds).all():
        raise InputError(f"{path}: log_odds has a value that is no number")
    if origin.shape != (2,) or not np.isfinite(origin).all():
        raise InputError(f"{path}: origin must be two numbers")
    known = FloorMap(np.clip(log_odds, -_MOST, _MOST), origin)
    if not known.contains((0.0, 0.0)):
        raise InputError(f"{path}: the grid does not contain the place where it was begun")
    return known


def transformed(pose: Pose, points: Vector) -> Vector:
    """Transforms points (N, 2) by a pose x, y, theta, to the frame in which the pose is given."""
    x, y, theta = pose
    c, s = np.cos(theta), np.sin(theta)
    return points @ np.array([[c, s], [-s, c]]) + (x, y)


def composed(first: Pose, second: Pose) -> Vector:
    """Returns the composition x, y, theta of two poses, `second` given in the frame `first`."""
    x, y = transformed(first, np.array([second[:2]], dtype=float))[0]
    theta = first[2] + second[2]
    return np.array([x, y, np.arctan2(np.sin(theta), np.cos(theta))])


def inverted(pose: Pose) -> Vector:
    """Returns the inverse of a pose."""
    x, y, theta = pose
    c, s = np.cos(theta), np.sin(theta)
    return np.array([-c * x - s * y, s * x - c * y, -theta])
