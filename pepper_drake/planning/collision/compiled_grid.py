"""Compiled look-ups in a distance grid that is measured where it is asked."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.compiled import compiled
from pepper_drake.learning.dmp.point_cells import PointCells, nearest_distances
from pepper_drake.planning.collision.compiled_arm import ArmChain, pose_links

Vector = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Numbers = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]
ROUNDING = np.float32(3 << 22)
"""Adding and subtracting it rounds a number below 2²² to the nearest integer."""


class Spheres(NamedTuple):
    """Spheres on an arm's links, and the layer of a grid in which each is looked up.

    Attributes:
        link: (S,) row of the link.
        centers: (S, 3) in the link's frame [m].
        radii: (S,) [m].
        layers: (S,) index of the layer.
    """

    link: Numbers
    centers: Vector
    radii: Floats
    layers: Numbers


class PlacedCloud(NamedTuple):
    """A cloud of points in a frame F, and the pose of the grid's frame T in it.

    Attributes:
        cells: The points.
        R_FT: (3, 3).
        p_FT: (3,) [m].
    """

    cells: PointCells
    R_FT: Vector
    p_FT: Vector


class GridArrays(NamedTuple):
    """A `DistanceGrid` of N nodes.

    Attributes:
        table: (L, N, 4) distances [m] and their differences per node along each axis.
        ready: (N,) whether the table is filled in.
        values: (L, N) distances where they are measured, upper bounds elsewhere [m].
        measured: (N,) whether the distance to the clouds is known.
        lower: (3,) position of the first node [m].
        spacing: Distance between nodes [m].
        counts: (3,) number of nodes along each axis.
        clouds: What is measured.
        cap: Distance up to which it is measured [m].
    """

    table: Floats
    ready: Mask
    values: Floats
    measured: Mask
    lower: Vector
    spacing: float
    counts: Numbers
    clouds: tuple[PlacedCloud, ...]
    cap: float


@compiled
def looked_up(points: Vector, layers: Numbers, grid: GridArrays) -> Floats:
    """Returns distances (M, S) [m] at points (M, S, 3), each in its layer (S,)."""
    spheres = points.shape[1]
    found, off = np.empty(points.shape[:2], np.float32), np.empty((spheres, 3), np.float32)
    nodes, missing = np.empty(spheres, np.int64), np.empty(spheres, np.int64)
    table, density = grid.table, np.float32(1.0 / grid.spacing)
    for m in range(points.shape[0]):
        count = 0
        for s in range(spheres):
            node = 0
            for k in range(3):
                scaled = np.float32(points[m, s, k] - grid.lower[k]) * density
                scaled = min(max(scaled, np.float32(0.0)), np.float32(grid.counts[k] - 1))
                nearest = (scaled + ROUNDING) - ROUNDING
                off[s, k], node = scaled - nearest, node * grid.counts[k] + int(nearest)
            nodes[s] = node
            if not grid.ready[node]:
                missing[count], grid.ready[node] = node, True
                count += 1
        if count:
            make_ready(missing[:count], grid)
        for s in range(spheres):
            node, layer = nodes[s], layers[s]
            distance = table[layer, node, 0] + table[layer, node, 1] * off[s, 0]
            distance += table[layer, node, 2] * off[s, 1]
            found[m, s] = distance + table[layer, node, 3] * off[s, 2]
    return found


@compiled
def keep_distances(
    joints: Vector, chain: ArmChain, spheres: Spheres, grid: GridArrays, least: Floats
) -> Mask:
    """Tells which postures (M, 5) keep the least distance of each sphere (S,) [m], (M,).

    Of a posture that does not, only the spheres up to the first too near are looked up.
    """
    keep, rows = np.ones(len(joints), np.bool_), chain.rows[5] + 1
    R, p = np.empty((3, 3)), np.empty(3)
    rotations, positions = np.empty((rows, 3, 3)), np.empty((rows, 3))
    axes, origins = np.empty((5, 3)), np.empty((5, 3))
    off, missing = np.empty(3, np.float32), np.empty(1, np.int64)
    density = np.float32(1.0 / grid.spacing)
    for m in range(len(joints)):
        for i in range(3):
            p[i] = 0.0
            for j in range(3):
                R[i, j] = 1.0 if i == j else 0.0
        pose_links(joints[m], chain, R, p, rotations, positions, axes, origins)
        for s in range(len(spheres.link)):
            link, layer, node = spheres.link[s], spheres.layers[s], 0
            x, y, z = spheres.centers[s]
            for i in range(3):
                along = rotations[link, i, 0] * x + rotations[link, i, 1] * y
                along += rotations[link, i, 2] * z + positions[link, i]
                scaled = np.float32(along - grid.lower[i]) * density
                scaled = min(max(scaled, np.float32(0.0)), np.float32(grid.counts[i] - 1))
                nearest = (scaled + ROUNDING) - ROUNDING
                off[i], node = scaled - nearest, node * grid.counts[i] + int(nearest)
            if not grid.ready[node]:
                missing[0], grid.ready[node] = node, True
                make_ready(missing, grid)
            row = grid.table[layer, node]
            distance = row[0] + row[1] * off[0] + row[2] * off[1] + row[3] * off[2]
            if distance - spheres.radii[s] < least[s]:
                keep[m] = False
                break
    return keep


@compiled
def make_ready(nodes: Numbers, grid: GridArrays) -> None:
    """Fills in the table for nodes (K,), which the caller has marked as ready.

    Differences per node are central; at the border they are one-sided.
    """
    _measure(nodes, grid)
    for node in nodes:
        stride = 1
        for axis in range(2, -1, -1):
            at = node // stride % grid.counts[axis]
            low = node - stride if at > 0 else node
            high = node + stride if at < grid.counts[axis] - 1 else node
            share = np.float32(0.5 if high - low == 2 * stride else 1.0)
            for layer in range(len(grid.values)):
                change = grid.values[layer, high] - grid.values[layer, low]
                grid.table[layer, node, axis + 1] = share * change
                grid.table[layer, node, 0] = grid.values[layer, node]
            stride *= grid.counts[axis]


@compiled
def _measure(nodes: Numbers, grid: GridArrays) -> None:
    """Measures the distances of nodes (K,) and of their neighbours to the clouds, once."""
    found, count, counts = np.empty(7 * len(nodes), np.int64), 0, grid.counts
    for node in nodes:
        stride = 1
        for axis in range(2, -1, -1):
            at = node // stride % counts[axis]
            for offset in range(-1 if at > 0 else 0, 2 if at < counts[axis] - 1 else 1):
                if not grid.measured[node + offset * stride]:
                    grid.measured[node + offset * stride] = True
                    found[count] = node + offset * stride
                    count += 1
            stride *= counts[axis]
    p_T, p_F = np.empty(3), np.empty((count, 3))
    for cloud in grid.clouds:
        for n in range(count):
            node = found[n]
            for axis in range(2, -1, -1):
                p_T[axis] = grid.lower[axis] + grid.spacing * (node % counts[axis])
                node //= counts[axis]
            for i in range(3):
                p_F[n, i] = cloud.p_FT[i]
                for j in range(3):
                    p_F[n, i] += cloud.R_FT[i, j] * p_T[j]
        distances = nearest_distances(p_F, cloud.cells, grid.cap)
        for n in range(count):
            for layer in range(len(grid.values)):
                known = grid.values[layer, found[n]]
                grid.values[layer, found[n]] = min(known, np.float32(distances[n]))
