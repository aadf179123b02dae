"""A map of the floor from the base's lasers: an occupancy grid, and what is found with it.

The grid holds log-odds (Elfes 1989; Thrun et al., Probabilistic Robotics, chapter 9), places are
explored by frontiers (Yamauchi 1997), and a pose is matched to the map by its likelihood field
(Thrun et al., chapter 6.4). The map's frame M is the base's at the start of the exploration.
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
"""Largest distance from M's origin, along each axis, of what a map holds [m]."""
_HIT, _FREE, _MOST = 1.5, -0.4, 5.0
"""Log-odds that a ray adds to where it ends, and to where it passes, and their limit."""
_RADIUS = 0.28
"""Radius of the base [m]."""
_CLEARANCE = _RADIUS + math.sqrt(0.5) * CELL + 0.5 * CELL
"""Distance that the base's middle keeps from the middle of an occupied cell [m]: what was seen may
be half of a diagonal nearer, and the pose is known to half of a cell."""
_MARGIN = 3
"""Cells of unknown around what is known."""
_LARGEST = 2 * round(EXTENT / CELL) + 2 * _MARGIN + 1
"""Most rows and columns of a map."""
_FARTHEST = 0.6
"""A hit farther from what the map knows tells nothing of the pose [m]."""
_FEWEST_HITS = 3
_STEPS = np.diag([CELL / 4, CELL / 4, 0.01])
"""Steps by which the slope of what a pose leaves is measured [m, rad]."""
_SMALLEST_FRONTIER = 3
"""Cells; a smaller one is a gap between two rays."""
_ELSEWHERE = 3 * CELL
"""From places nearer than this to one where it was no more is seen than from there [m]."""
_AROUND = np.indices((11, 11)).reshape(2, -1).T - 5
"""Cells that may be within `_CLEARANCE` of another one, relative to it."""


@dataclass(frozen=True)
class LaserScan:
    """One scan in the base's frame.

    Attributes:
        starts: Where the rays start (N, 2) [m].
        ends: Where they end (N, 2) [m].
        hits: Those that hit something (N,).
    """

    starts: Vector
    ends: Vector
    hits: Mask


@dataclass(frozen=True)
class FloorMap:
    """The grid. It does not change, so that threads may share it: a scan makes another one.

    Attributes:
        log_odds: Of being occupied (rows, columns), rows along y, columns along x.
        origin: Least x and y of the grid in M [m].
    """

    log_odds: Vector = field(default_factory=lambda: np.zeros((1, 1)))
    origin: Vector = field(default_factory=lambda: np.zeros(2))

    @cached_property
    def is_occupied(self) -> Mask:
        """Cells (rows, columns) in which something was seen more often than not."""
        occupied: Mask = self.log_odds > 0.0
        return occupied

    @cached_property
    def is_free(self) -> Mask:
        """Cells (rows, columns) known to be free; those not occupied either are unknown."""
        free: Mask = self.log_odds < 0.5 * _FREE
        return free

    @cached_property
    def _distance(self) -> Vector:
        """Distance of each cell from the nearest occupied one [m]."""
        if not self.is_occupied.any():
            return np.full(self.log_odds.shape, np.inf)
        return np.asarray(CELL * ndimage.distance_transform_edt(~self.is_occupied))

    def with_scan(self, scan: LaserScan, pose: Pose) -> "FloorMap":
        """Returns the map with a scan that was taken at the base's pose in M.

        What the scan saw beyond `EXTENT` is left out.

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
        # Each cell once a scan; where a ray ends none passes.
        free = np.unique(grown._inside(passed), axis=0)
        grown.log_odds[free[:, 0], free[:, 1]] += _FREE
        hit = np.unique(grown._inside(ended), axis=0)
        grown.log_odds[hit[:, 0], hit[:, 1]] += _HIT - _FREE
        np.clip(grown.log_odds, -_MOST, _MOST, out=grown.log_odds)
        return grown

    def percent(self) -> npt.NDArray[np.int64]:
        """Returns how likely each cell is occupied, 0 to 100, from the top row down: 50 unknown."""
        return np.rint(100.0 / (1.0 + np.exp(-self.log_odds[::-1]))).astype(np.int64)

    def matched(self, scan: LaserScan, pose: Pose) -> tuple[Vector, float]:
        """Returns the pose near a guess at which a scan's hits lie best on the map.

        Args:
            scan: The scan.
            pose: The guess: x, y, theta [m, rad].

        Returns:
            The pose, and the hits' mean distance there from what the map knows, at most 0.6 m
            each [m]; infinite if the scan or the map has too little for a pose.
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
        """Returns whether a place, x, y in M [m], is on the grid."""
        return bool(len(self._inside(self._cells(np.array([place[:2]], dtype=float)))))

    def path(self, start: Pose, goal: Pose) -> list[Vector] | None:
        """Returns points (2,) in M of a way through what is known to be free; None without one."""
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
        """Returns whether the straight line between two places is known to be free."""
        if not (self.contains(start) and self.contains(end)):
            return False
        points = np.array([start[:2], end[:2]], dtype=float)
        return self._sees(self._drivable(start), points[0], points[1])

    def frontier(
        self, start: Pose, radius: float, looked_from: Sequence[Vector]
    ) -> list[Vector] | None:
        """Returns the way to the nearest place from which more may be seen; None without one.

        Args:
            start: Where the base stands, x, y in M [m].
            radius: Largest distance of such a place from M's origin [m].
            looked_from: Places (2,) in M that are no such place any more [m].
        """
        if not self.contains(start):
            return None
        free = self._drivable(start)
        edge = self.is_free & ndimage.binary_dilation(~(self.is_free | self.is_occupied))
        labels, number = ndimage.label(edge, np.ones((3, 3)))
        sizes = ndimage.sum_labels(edge, labels, np.arange(number + 1))
        edge &= sizes[labels] >= _SMALLEST_FRONTIER
        # It sees the edge from where it may stand.
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
        """Cells known to be free with enough room around them."""
        return self.is_free & (self._distance > _CLEARANCE)

    def _drivable(self, start: Pose) -> Mask:
        """Cells that the base may drive over: those with room, and those that lead there.

        Where it stands nearer to something, it may drive on as long as it comes no nearer.
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
        """Dijkstra's search over the eight neighbours of each free cell."""
        number_of = np.cumsum(free).reshape(free.shape) - 1
        rows, columns, costs = [], [], []
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            here = free[: free.shape[0] - dy, max(-dx, 0) : free.shape[1] - max(dx, 0)]
            there = free[dy:, max(dx, 0) : free.shape[1] + min(dx, 0)]
            both = here & there
            if dy and dx:  # Past a corner there is no way.
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
        """The way to an end in the target, without the points that straight lines make needless."""
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
        """Returns whether a line is free and has room, or as much as where it starts."""
        shares = np.linspace(0.0, 1.0, int(4 * np.linalg.norm(end - start) / CELL) + 2)
        points = start + shares[:, None] * (end - start)
        cells = self._cells(points)
        room = self._at(np.minimum(self._distance, 1.0), points, 0.0)
        is_clear = room >= min(_CLEARANCE, room[0])
        return bool((is_clear & free[cells[:, 0], cells[:, 1]]).all())

    def _at(self, values: Vector, points: Vector, outside: float) -> Vector:
        """Values of cells' middles (rows, columns), interpolated at points (N, 2) in M."""
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
        """Those of some cells (N, 2) that are on the grid."""
        return cells[((cells >= 0) & (cells < self.log_odds.shape)).all(axis=1)]

    def _grown(self, points: Vector) -> "FloorMap":
        """Returns a copy with room for points; it stays a square, as programs take it for one."""
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
    """Writes a map, whole or not at all.

    Raises:
        InputError: The folder cannot be written to.
    """
    content = io.BytesIO()
    np.savez_compressed(content, log_odds=known.log_odds, origin=known.origin)
    write_atomically(path, content.getvalue())


def read_floor_map(path: Path) -> FloorMap:
    """Reads a map that `write_floor_map` wrote.

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
    """Returns points (N, 2) of a frame at the pose x, y, theta in the frame of that pose."""
    x, y, theta = pose
    c, s = np.cos(theta), np.sin(theta)
    return points @ np.array([[c, s], [-s, c]]) + (x, y)


def composed(first: Pose, second: Pose) -> Vector:
    """Returns the pose x, y, theta of what is at `second` in a frame that is at `first`."""
    x, y = transformed(first, np.array([second[:2]], dtype=float))[0]
    theta = first[2] + second[2]
    return np.array([x, y, np.arctan2(np.sin(theta), np.cos(theta))])


def inverted(pose: Pose) -> Vector:
    """Returns the pose of the frame in which a pose is given, in that pose's frame."""
    x, y, theta = pose
    c, s = np.cos(theta), np.sin(theta)
    return np.array([-c * x - s * y, s * x - c * y, -theta])
