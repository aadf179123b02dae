"""Compiled look-ups in a distance grid that is measured where it is asked."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.compiled import compiled

Vector = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Numbers = npt.NDArray[np.int64]
ROUNDING = np.float32(3 << 22)
"""Adding and subtracting it rounds a number below 2²² to the nearest integer."""
UNKNOWN, ASKED_FOR, READY = range(3)
"""States of a grid's node: not measured, requested, or measured."""


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


class GridArrays(NamedTuple):
    """A `DistanceGrid` of N nodes.

    Attributes:
        table: (L, N, 4) distances [m] and their differences per node along each axis.
        state: (N,) of the nodes; the table is valid for those that are READY.
        lower: (3,) position of the first node [m].
        density: Nodes per metre.
        counts: (3,) number of nodes along each axis.
    """

    table: Floats
    state: npt.NDArray[np.uint8]
    lower: Vector
    density: float
    counts: Numbers


@compiled
def looked_up(points: Vector, layers: Numbers, grid: GridArrays) -> tuple[Floats, Numbers]:
    """Returns distances (M, S) [m] at points (M, S, 3), and the nodes (K,) that must be measured.

    The distances are valid if there are none.
    """
    found, off = np.empty(points.shape[:2], np.float32), np.empty(3, np.float32)
    missing, count = np.empty(len(grid.state), np.int64), 0
    table, density = grid.table, np.float32(grid.density)
    for m in range(points.shape[0]):
        for s in range(points.shape[1]):
            node, layer = 0, layers[s]
            for k in range(3):
                scaled = np.float32(points[m, s, k] - grid.lower[k]) * density
                scaled = min(max(scaled, np.float32(0.0)), np.float32(grid.counts[k] - 1))
                nearest = (scaled + ROUNDING) - ROUNDING
                off[k], node = scaled - nearest, node * grid.counts[k] + int(nearest)
            distance = table[layer, node, 0] + table[layer, node, 1] * off[0]
            distance += table[layer, node, 2] * off[1]
            found[m, s] = distance + table[layer, node, 3] * off[2]
            if grid.state[node] == UNKNOWN:
                missing[count], grid.state[node] = node, ASKED_FOR
                count += 1
    return found, missing[:count]


@compiled
def not_measured(
    nodes: Numbers, measured: npt.NDArray[np.bool_], counts: Numbers, lower: Vector, spacing: float
) -> tuple[Numbers, Vector]:
    """Returns the unmeasured of nodes (K,) and of their neighbours, and marks them as measured.

    Args:
        nodes: (K,).
        measured: (N,) of all nodes, modified in place.
        counts: (3,) number of nodes along each axis.
        lower: (3,) position of the first node [m].
        spacing: Distance between nodes [m].

    Returns:
        Their numbers (M,) and positions (M, 3) [m].
    """
    found, count = np.empty(7 * len(nodes), np.int64), 0
    for node in nodes:
        stride = 1
        for axis in range(2, -1, -1):
            at = node // stride % counts[axis]
            for offset in range(-1 if at > 0 else 0, 2 if at < counts[axis] - 1 else 1):
                if not measured[node + offset * stride]:
                    measured[node + offset * stride] = True
                    found[count] = node + offset * stride
                    count += 1
            stride *= counts[axis]
    places = np.empty((count, 3))
    for n in range(count):
        node = found[n]
        for axis in range(2, -1, -1):
            places[n, axis] = lower[axis] + spacing * (node % counts[axis])
            node //= counts[axis]
    return found[:count], places


@compiled
def make_rows(nodes: Numbers, values: Floats, grid: GridArrays) -> None:
    """Fills in the table for nodes (K,) from distances (L, N), and marks them as READY.

    Differences per node are central; at the border they are one-sided.
    """
    for node in nodes:
        stride = 1
        for axis in range(2, -1, -1):
            at = node // stride % grid.counts[axis]
            low = node - stride if at > 0 else node
            high = node + stride if at < grid.counts[axis] - 1 else node
            share = np.float32(0.5 if high - low == 2 * stride else 1.0)
            for layer in range(len(values)):
                change = values[layer, high] - values[layer, low]
                grid.table[layer, node, axis + 1] = share * change
                grid.table[layer, node, 0] = values[layer, node]
            stride *= grid.counts[axis]
        grid.state[node] = READY
