"""The nearest of points that are sorted into cells: made in a tenth of a k-d tree's time."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.compiled import compiled

Array = npt.NDArray[np.float64]

_CELL, _MOST_CELLS = 0.04, 64
"""Edge of a cell [m], and most cells along an axis: points that are far apart get larger ones."""

_ITSELF = np.zeros((1, 3))


class PointCells(NamedTuple):
    """Points in the order of their cells.

    Attributes:
        points: (P, 3) [m].
        first: (I J K + 1,) index of the first point of each cell, the last axis fastest.
        lower: (3,) corner of the first cell [m].
        counts: (3,) number of cells along each axis.
        size: Edge of a cell [m].
    """

    points: Array
    first: npt.NDArray[np.int64]
    lower: Array
    counts: npt.NDArray[np.int64]
    size: float

    @classmethod
    def of(cls, points: Array, offsets: Array = _ITSELF) -> "PointCells":
        """Sorts points (P, 3) [m], each of them at K offsets (K, 3) from it."""
        if not len(points):
            return cls(np.zeros((0, 3)), np.zeros(2, int), np.zeros(3), np.ones(3, int), _CELL)
        return cls(*_sorted(np.array(points, order="C"), offsets))


@compiled
def _sorted(
    points: Array, offsets: Array
) -> tuple[Array, npt.NDArray[np.int64], Array, npt.NDArray[np.int64], float]:
    """Returns what `PointCells` holds."""
    lower, upper, size = np.full(3, np.inf), np.full(3, -np.inf), _CELL
    for n in range(len(points)):
        for k in range(3):
            lower[k], upper[k] = min(lower[k], points[n, k]), max(upper[k], points[n, k])
    for k in range(3):
        lower[k] += offsets[:, k].min()
        size = max(size, (upper[k] + offsets[:, k].max() - lower[k]) / _MOST_CELLS)
    counts = np.empty(3, np.int64)
    for k in range(3):
        counts[k] = int((upper[k] + offsets[:, k].max() - lower[k]) / size) + 1
    cells = np.empty((len(offsets), len(points)), np.int32)
    first = np.zeros(counts[0] * counts[1] * counts[2] + 1, np.int64)
    density = 1.0 / size
    for m in range(len(offsets)):
        u, v, w = offsets[m]
        for n in range(len(points)):
            i = min(int((points[n, 0] + u - lower[0]) * density), counts[0] - 1)
            j = min(int((points[n, 1] + v - lower[1]) * density), counts[1] - 1)
            k = min(int((points[n, 2] + w - lower[2]) * density), counts[2] - 1)
            cells[m, n] = (i * counts[1] + j) * counts[2] + k
            first[cells[m, n] + 1] += 1
    for cell in range(len(first) - 1):
        first[cell + 1] += first[cell]
    place, ordered = first.copy(), np.empty((cells.size, 3))
    for m in range(len(offsets)):
        u, v, w = offsets[m]
        for n in range(len(points)):
            row = place[cells[m, n]]
            place[cells[m, n]] += 1
            ordered[row, 0] = points[n, 0] + u
            ordered[row, 1] = points[n, 1] + v
            ordered[row, 2] = points[n, 2] + w
    return ordered, first, lower, counts, size


@compiled
def _span(place: float, bound: float, density: float, count: int) -> tuple[int, int]:
    """First cell along an axis within a bound of a place, and the one after the last of them."""
    low, high = np.floor((place - bound) * density), np.floor((place + bound) * density) + 1.0
    return int(min(max(low, 0.0), count)), int(min(max(high, 0.0), count))


@compiled
def _nearest(x: float, y: float, z: float, bound: float, cells: PointCells) -> float:
    """Distance of a place to the nearest point, `bound` if none is nearer [m]."""
    points, first, lower, counts, size = cells
    u, v, w, density = x - lower[0], y - lower[1], z - lower[2], 1.0 / size
    i_0, i_1 = _span(u, bound, density, counts[0])
    j_0, j_1 = _span(v, bound, density, counts[1])
    best = bound * bound
    for i in range(i_0, i_1):
        a = max(size * i - u, u - size * (i + 1), 0.0)
        for j in range(j_0, j_1):
            b = max(size * j - v, v - size * (j + 1), 0.0)
            left = best - a * a - b * b
            if left <= 0.0:
                continue
            k_0, k_1 = _span(w, math.sqrt(left), density, counts[2])
            row = (i * counts[1] + j) * counts[2]
            # The cells of a row lie one behind the other, and so do their points.
            for n in range(first[row + k_0], first[row + k_1]):
                c, d, e = points[n, 0] - x, points[n, 1] - y, points[n, 2] - z
                best = min(best, c * c + d * d + e * e)
    return math.sqrt(best)


@compiled
def minimum_gaps(centers: Array, radii: Array, cells: PointCells, within: float) -> Array:
    """Least distance (M,) of spheres to the points in each of M postures [m].

    A sphere cannot have come nearer than by its way since it was last looked at: most are not
    looked at again, since others are nearer.

    Args:
        centers: (M, S, 3) [m].
        radii: (S,) [m].
        cells: The points.
        within: Beyond this the distance is infinite [m].
    """
    count = centers.shape[1]
    least = np.full(len(centers), np.inf)
    known = np.full(count, -np.inf)  # Distance that each centre has at least.
    last = 0
    for m in range(len(centers)):
        best, nearest = within, -1
        for number in range(count):
            s = (last + number) % count
            if m:
                u = centers[m, s, 0] - centers[m - 1, s, 0]
                v = centers[m, s, 1] - centers[m - 1, s, 1]
                w = centers[m, s, 2] - centers[m - 1, s, 2]
                known[s] -= math.sqrt(u * u + v * v + w * w)
            if known[s] - radii[s] >= best:
                continue
            bound = best + radii[s]
            if bound <= 0.0:
                known[s] = 0.0
                continue
            # Looking a little farther than needed saves looking again in the next postures.
            x, y, z = centers[m, s]
            known[s] = _nearest(x, y, z, bound + 0.02, cells)
            if known[s] < bound:
                best, nearest = known[s] - radii[s], s
        if nearest >= 0:
            least[m], last = best, nearest
    return least


@compiled
def nearest_distances(places: Array, cells: PointCells, within: float) -> Array:
    """Distance (N,) of places (N, 3) to the nearest point, infinite beyond `within` [m]."""
    found = np.full(len(places), np.inf)
    known = within  # Distance that the last place had at most.
    for n in range(len(places)):
        x, y, z = places[n]
        if n:
            u, v, w = x - places[n - 1, 0], y - places[n - 1, 1], z - places[n - 1, 2]
            known += math.sqrt(u * u + v * v + w * w)
        bound = min(known * (1.0 + 1e-9) + 1e-9, within)
        distance = _nearest(x, y, z, bound, cells)
        known = within
        if distance < bound:
            found[n] = known = distance
    return found


@compiled
def _nearest_points(
    x: float, y: float, z: float, bound: float, cells: PointCells, squares: Array
) -> npt.NDArray[np.int64]:
    """Indices (K,) of the points nearest to a place; their squared distances (K,) in `squares`.

    They are looked for within a bound first [m], then farther away.
    """
    points, first, lower, counts, size = cells
    count = len(squares)
    chosen = np.empty(count, np.int64)
    u, v, w, density = x - lower[0], y - lower[1], z - lower[2], 1.0 / size
    while True:
        i_0, i_1 = _span(u, bound, density, counts[0])
        j_0, j_1 = _span(v, bound, density, counts[1])
        k_0, k_1 = _span(w, bound, density, counts[2])
        found, cells_looked_at = 0, (i_1 - i_0) * (j_1 - j_0) * (k_1 - k_0)
        for i in range(i_0, i_1):
            a = max(size * i - u, u - size * (i + 1), 0.0)
            for j in range(j_0, j_1):
                b = max(size * j - v, v - size * (j + 1), 0.0)
                if found == count:
                    left = squares[count - 1] - a * a - b * b
                    if left <= 0.0:
                        continue
                    k_0, k_1 = _span(w, math.sqrt(left), density, counts[2])
                row = (i * counts[1] + j) * counts[2]
                for n in range(first[row + k_0], first[row + k_1]):
                    c, d, e = points[n, 0] - x, points[n, 1] - y, points[n, 2] - z
                    square = c * c + d * d + e * e
                    if found == count and square >= squares[count - 1]:
                        continue
                    found = min(found + 1, count)
                    k = found - 1
                    while k > 0 and squares[k - 1] > square:
                        squares[k], chosen[k] = squares[k - 1], chosen[k - 1]
                        k -= 1
                    squares[k], chosen[k] = square, n
        # All within the bound were looked at; what is chosen beyond it need not be the nearest.
        whole = cells_looked_at == len(first) - 1
        if whole or (found == count and squares[count - 1] <= bound * bound):
            return chosen
        bound *= 2.0


@compiled
def blended_directions(
    places: Array, cells: PointCells, count: int, blending: float
) -> tuple[Array, Array]:
    """Distances (N,) [m] to the nearest point, and directions (N, 3) away from the nearest few.

    Args:
        places: (N, 3) [m].
        cells: The points.
        count: Of points that a direction is blended of, at most as many as there are.
        blending: Distance over which the weight of a point falls [m].
    """
    distances, directions = np.empty(len(places)), np.empty((len(places), 3))
    squares, total = np.empty(count), np.empty(3)
    bound = cells.size
    for n in range(len(places)):
        x, y, z = places[n]
        if n:  # The last of the nearest is not farther than it was and the way since.
            u, v, w = x - places[n - 1, 0], y - places[n - 1, 1], z - places[n - 1, 2]
            bound = math.sqrt(squares[count - 1]) + math.sqrt(u * u + v * v + w * w) + 1e-9
        chosen = _nearest_points(x, y, z, bound, cells, squares)
        nearest = math.sqrt(squares[0])
        total[:] = 0.0
        for k in range(count):
            distance = math.sqrt(squares[k])
            weight = math.exp((nearest - distance) / blending) / max(distance, 1e-9)
            for i in range(3):
                total[i] += weight * (places[n, i] - cells.points[chosen[k], i])
        length = math.sqrt(np.sum(total * total))
        if length <= 1e-9:
            # Directions may cancel out inside a solid: there the nearest point alone decides.
            total[:] = places[n] - cells.points[chosen[0]]
            length = max(math.sqrt(np.sum(total * total)), 1e-12)
        distances[n], directions[n] = nearest, total / length
    return distances, directions
