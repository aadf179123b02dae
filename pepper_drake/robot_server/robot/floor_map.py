"""A map of the floor from the base's lasers: an occupancy grid, and what is found with it.

The grid holds log-odds (Elfes 1989; Thrun et al., Probabilistic Robotics, chapter 9), places are
explored by frontiers (Yamauchi 1997), and a pose is matched to the map by its likelihood field
(Thrun et al., chapter 6.4). The map's frame M is the base's at the start of the exploration.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
from scipy import ndimage, optimize, sparse
from scipy.sparse import csgraph

Vector = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Pose = Sequence[float] | Vector

CELL = 0.1
"""Edge of a cell [m]."""
_HIT, _FREE, _MOST = 1.5, -0.4, 5.0
"""Log-odds that a ray adds to where it ends, and to where it passes, and their limit."""
_CLEARANCE = 0.35
"""Distance from what was seen that the base's middle keeps [m]: its radius is 0.28 m."""
_MARGIN = 3
"""Cells of unknown around what is known."""
_FARTHEST = 0.6
"""A hit farther from what the map knows tells nothing of the pose [m]."""
_SMALLEST_FRONTIER = 3
"""Cells; a smaller one is a gap between two rays."""


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


@dataclass
class FloorMap:
    """The grid; it grows with what is seen.

    Attributes:
        log_odds: Of being occupied (rows, columns), rows along y, columns along x.
        origin: Least x and y of the grid in M [m].
    """

    log_odds: Vector = field(default_factory=lambda: np.zeros((1, 1)))
    origin: Vector = field(default_factory=lambda: np.zeros(2))

    def add(self, scan: LaserScan, pose: Pose) -> None:
        """Adds a scan that was taken at the base's pose x, y, theta in M [m, rad]."""
        starts, ends = transformed(pose, scan.starts), transformed(pose, scan.ends)
        self._grow(np.vstack((starts, ends)))
        length = float(np.linalg.norm(ends - starts, axis=1).max())
        shares = np.linspace(0.0, 1.0, int(2 * length / CELL) + 2)[:, None, None]
        passed = self._cells((starts + shares * (ends - starts)).reshape(-1, 2))
        ended = self._cells(ends[scan.hits])
        # Each cell once a scan; where a ray ends none passes.
        free = np.unique(passed, axis=0)
        self.log_odds[free[:, 0], free[:, 1]] += _FREE
        hit = np.unique(ended, axis=0)
        self.log_odds[hit[:, 0], hit[:, 1]] += _HIT - _FREE
        np.clip(self.log_odds, -_MOST, _MOST, out=self.log_odds)

    def percent(self) -> npt.NDArray[np.int64]:
        """Returns how likely each cell is occupied, 0 to 100, from the top row down: 50 unknown."""
        return np.rint(100.0 / (1.0 + np.exp(-self.log_odds[::-1]))).astype(np.int64)

    def matched(self, scan: LaserScan, pose: Pose) -> Vector:
        """Returns the pose near a guess at which a scan's hits lie best on the map."""
        occupied = self.log_odds > 0.0
        hits = scan.ends[scan.hits]
        if not occupied.any() or len(hits) < 3:
            return np.array(pose)
        distance = np.minimum(CELL * ndimage.distance_transform_edt(~occupied), _FARTHEST)

        def residuals(guess: Vector) -> Vector:
            cells = (transformed(guess, hits) - self.origin) / CELL - 0.5
            found = ndimage.map_coordinates(
                distance, cells[:, ::-1].T, order=1, mode="constant", cval=_FARTHEST
            )
            return np.asarray(found)

        found = optimize.least_squares(
            residuals, np.array(pose), loss="soft_l1", f_scale=CELL, diff_step=np.full(3, 1e-3)
        )
        return np.asarray(found.x)

    def path(self, start: Pose, goal: Pose) -> list[Vector] | None:
        """Returns points (2,) in M of a way through what is known to be free; None without one."""
        free = self._drivable(start)
        target = self._cells(np.array([goal[:2]]))[0]
        if not self._is_inside(target) or not free[tuple(target)]:
            return None
        return self._way(free, start, target, np.array(goal[:2], dtype=float))

    def frontier(self, start: Pose, radius: float) -> list[Vector] | None:
        """Returns the way to the nearest place from which more may be seen; None without one.

        Args:
            start: Where the base stands, x, y in M [m].
            radius: Largest distance of such a place from M's origin [m].
        """
        free = self._drivable(start)
        unknown = np.abs(self.log_odds) < 0.5 * abs(_FREE)
        edge = (self.log_odds < 0.0) & ndimage.binary_dilation(unknown)
        labels, number = ndimage.label(edge, np.ones((3, 3)))
        sizes = ndimage.sum_labels(edge, labels, np.arange(number + 1))
        edge &= sizes[labels] >= _SMALLEST_FRONTIER
        # It sees the edge from where it may stand.
        reach = int(np.ceil((_CLEARANCE + 2 * CELL) / CELL))
        places = free & ndimage.binary_dilation(edge, iterations=reach)
        centres = self._centres(np.argwhere(places))
        near = np.linalg.norm(centres, axis=1) <= radius
        far = np.linalg.norm(centres - np.array(start[:2]), axis=1) > 3 * CELL
        wanted = np.argwhere(places)[near & far]
        if not len(wanted):
            return None
        predecessors, cost, number_of = self._search(free, start)
        costs = cost[number_of[wanted[:, 0], wanted[:, 1]]]
        best = int(np.argmin(costs))
        if not np.isfinite(costs[best]):
            return None
        return self._traced(free, predecessors, number_of, wanted[best], start)

    def _way(
        self, free: Mask, start: Pose, target: npt.NDArray[np.int64], goal: Vector
    ) -> list[Vector] | None:
        predecessors, cost, number_of = self._search(free, start)
        if not np.isfinite(cost[number_of[tuple(target)]]):
            return None
        return [*self._traced(free, predecessors, number_of, target, start)[:-1], goal]

    def _drivable(self, start: Pose) -> Mask:
        """Cells known to be free with enough room around them; where it stands is one."""
        known_free = self.log_odds < 0.0
        room = CELL * ndimage.distance_transform_edt(self.log_odds <= 0.0) > _CLEARANCE
        free: Mask = known_free & room
        here = self._centres(np.indices(free.shape).reshape(2, -1).T)
        stands = np.linalg.norm(here - np.array(start[:2]), axis=1) < _CLEARANCE
        return free | (stands.reshape(free.shape) & (self.log_odds <= 0.0))

    def _search(
        self, free: Mask, start: Pose
    ) -> tuple[npt.NDArray[np.int32], Vector, npt.NDArray[np.int64]]:
        """Dijkstra's search over the eight neighbours of each free cell."""
        number_of = np.cumsum(free).reshape(free.shape) - 1
        rows, columns, costs = [], [], []
        for dy, dx in ((0, 1), (1, 0), (1, 1), (1, -1)):
            here = free[: free.shape[0] - dy, max(-dx, 0) : free.shape[1] - max(dx, 0)]
            there = free[dy:, max(dx, 0) : free.shape[1] + min(dx, 0)]
            both = here & there
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
        number_of: npt.NDArray[np.int64],
        target: npt.NDArray[np.int64],
        start: Pose,
    ) -> list[Vector]:
        """The way back to the start, without the points that straight lines make needless."""
        cells = np.argwhere(free)
        numbers = [int(number_of[tuple(target)])]
        while predecessors[numbers[-1]] >= 0:
            numbers.append(int(predecessors[numbers[-1]]))
        points = [np.array(start[:2], dtype=float), *self._centres(cells[numbers[::-1]])[1:]]
        kept, last = [], 0
        while last < len(points) - 1:
            ahead = range(len(points) - 1, last, -1)
            last = next((k for k in ahead if self._sees(free, points[last], points[k])), last + 1)
            kept.append(points[last])
        return kept

    def _sees(self, free: Mask, start: Vector, end: Vector) -> bool:
        shares = np.linspace(0.0, 1.0, int(4 * np.linalg.norm(end - start) / CELL) + 2)
        cells = self._cells(start + shares[:, None] * (end - start))
        return bool(free[cells[:, 0], cells[:, 1]].all())

    def _cells(self, points: Vector) -> npt.NDArray[np.int64]:
        return np.floor((points - self.origin) / CELL).astype(np.int64)[:, ::-1]

    def _centres(self, cells: npt.NDArray[np.int64]) -> Vector:
        return self.origin + CELL * (cells[:, ::-1] + 0.5)

    def _is_inside(self, cell: npt.NDArray[np.int64]) -> bool:
        return bool(np.all(cell >= 0) and np.all(cell < self.log_odds.shape))

    def _grow(self, points: Vector) -> None:
        """Makes room for points; the grid stays a square, as programs take it for one."""
        cells = self._cells(points)
        rows, columns = self.log_odds.shape
        if np.all(cells >= _MARGIN) and np.all(cells < np.array([rows, columns]) - _MARGIN):
            return
        least = np.minimum(cells.min(axis=0) - _MARGIN, 0)
        most = np.maximum(cells.max(axis=0) + _MARGIN + 1, (rows, columns))
        size = int((most - least).max())
        grown = np.zeros((size, size))
        y, x = -least
        grown[y : y + rows, x : x + columns] = self.log_odds
        self.origin = self.origin + CELL * least[::-1]
        self.log_odds = grown


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
