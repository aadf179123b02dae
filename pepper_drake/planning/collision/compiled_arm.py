"""Postures of an arm, their distances on a grid and what paths cost, compiled.

All that is compiled stands in this file (see `compiled`).
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.compiled import compiled

Vector = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Numbers = npt.NDArray[np.int64]
UNKNOWN, ASKED_FOR, READY = range(3)
"""States of a grid's node: nothing of it is known, it will be measured next, or it was."""


class ArmChain(NamedTuple):
    """An arm's five joints and its hand as plain arrays.

    Attributes:
        rotations: (6, 3, 3) of each joint's frame in its parent link, then of the hand in its link.
        positions: (6, 3) their origins there [m].
        axis_numbers: (5,) which coordinate axis each joint turns about.
        senses: (5,) 1 or -1.
        rows: (6,) under which number the link after each joint is noted, then the hand; -1 for
            none.
    """

    rotations: Vector
    positions: Vector
    axis_numbers: Numbers
    senses: Vector
    rows: Numbers


class Spheres(NamedTuple):
    """Spheres on an arm's links, and on which layer of a grid each is looked up.

    Attributes:
        link: (S,) number of the link.
        centers: (S, 3) in its frame [m].
        radii: (S,) m.
        layers: (S,).
    """

    link: Numbers
    centers: Vector
    radii: Floats
    layers: Numbers


class GridArrays(NamedTuple):
    """A `DistanceGrid` of N nodes.

    Attributes:
        table: (L, N, 4) distances [m] and their changes from node to node along each axis.
        state: (N,) of the nodes; what the table says holds for those that are ready.
        lower: (3,) the first node [m].
        density: Nodes a metre.
        counts: (3,) number of nodes a side.
    """

    table: Floats
    state: npt.NDArray[np.uint8]
    lower: Vector
    density: float
    counts: Numbers


class CostNumbers(NamedTuple):
    """Numbers of `TrajectoryCost`.

    Attributes:
        hand: (R, N, 3) the references' hand positions [m]; of one for all paths, or of one each.
        wanted: (R, N, S) clearance wanted of each sphere [m].
        velocity: (5,) of the joints at most [rad/s].
        acceleration: (5,) likewise [rad/s²].
        duration: Of the paths [s].
        density: 1 / clearance [1/m].
        weights: (5,) of proximity, slack, deviation, effort and duration.
    """

    hand: Vector
    wanted: Floats
    velocity: Vector
    acceleration: Vector
    duration: float
    density: float
    weights: Vector


@compiled
def _pose_links(
    q: Vector,
    chain: ArmChain,
    R: Vector,
    p: Vector,
    rotations: Vector,
    positions: Vector,
    axes: Vector,
    origins: Vector,
) -> None:
    """Takes R, p from the torso's pose to the hand's, and notes all poses on the way."""
    for k in range(6):
        C, (x, y, z) = chain.rotations, chain.positions[k]
        for i in range(3):
            a, b, c = R[i, 0], R[i, 1], R[i, 2]
            p[i] += a * x + b * y + c * z
            for j in range(3):
                R[i, j] = a * C[k, 0, j] + b * C[k, 1, j] + c * C[k, 2, j]
        if k < 5:
            number, sense = chain.axis_numbers[k], chain.senses[k]
            first, second = (number + 1) % 3, (number + 2) % 3
            cos, sin = math.cos(q[k]), sense * math.sin(q[k])
            for i in range(3):
                axes[k, i], origins[k, i] = sense * R[i, number], p[i]
                a, b = R[i, first], R[i, second]
                R[i, first], R[i, second] = a * cos + b * sin, b * cos - a * sin
        row = chain.rows[k]
        if row >= 0:
            for i in range(3):
                positions[row, i] = p[i]
                for j in range(3):
                    rotations[row, i, j] = R[i, j]


@compiled
def link_poses(
    joints: Vector, R_FT: Vector, p_FT: Vector, chain: ArmChain
) -> tuple[Vector, Vector, Vector, Vector]:
    """The arrays of `ArmPoses` in a frame F, at joints (M, 5) [rad]."""
    count, rows = len(joints), chain.rows[5] + 1
    rotations, positions = np.empty((count, rows, 3, 3)), np.empty((count, rows, 3))
    axes, origins = np.empty((count, 5, 3)), np.empty((count, 5, 3))
    R, p = np.empty((3, 3)), np.empty(3)
    for m in range(count):
        R[:], p[:] = R_FT, p_FT
        _pose_links(joints[m], chain, R, p, rotations[m], positions[m], axes[m], origins[m])
    return rotations, positions, axes, origins


@compiled
def placed_points(rotations: Vector, positions: Vector, link: Numbers, points: Vector) -> Vector:
    """Points (S, 3) of links (S,) where poses (M, L, ...) put them, (M, S, 3) [m]."""
    placed = np.empty((len(rotations), len(link), 3))
    for m in range(len(rotations)):
        for s in range(len(link)):
            x, y, z = points[s]
            for i in range(3):
                R = rotations[m, link[s], i]
                placed[m, s, i] = R[0] * x + R[1] * y + R[2] * z + positions[m, link[s], i]
    return placed


@compiled
def reach_point(
    target: Vector,
    joints: Vector,
    limits: Vector,
    chain: ArmChain,
    steps: int,
    damping: float,
    largest: float,
) -> Vector:
    """Moves postures until their hands are at a point, by damped least squares.

    Args:
        target: (3,) in T [m].
        joints: (M, 5) changed [rad].
        limits: (2, 5) lower and upper, kept by clipping [rad].
        chain: Of the arm.
        steps: How many.
        damping: See `damped_least_squares` [m/rad].
        largest: Motion of a joint in one step at most [rad].

    Returns:
        (M,) distances of the hands from the point [m].
    """
    left, rows = np.empty(len(joints)), chain.rows[5] + 1
    R, p, error, J = np.empty((3, 3)), np.empty(3), np.empty(3), np.empty((3, 5))
    L, z, change = np.empty((3, 3)), np.empty(3), np.empty(5)
    rotations, positions = np.empty((rows, 3, 3)), np.empty((rows, 3))
    axes, origins = np.empty((5, 3)), np.empty((5, 3))
    for m in range(len(joints)):
        q = joints[m]
        for step in range(steps + 1):
            for i in range(3):
                p[i] = 0.0
                for j in range(3):
                    R[i, j] = 1.0 if i == j else 0.0
            _pose_links(q, chain, R, p, rotations, positions, axes, origins)
            for i in range(3):
                error[i] = target[i] - p[i]
            left[m] = math.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
            if step == steps:
                break
            for k in range(5):
                u, v, w = axes[k]
                x, y, c = p[0] - origins[k, 0], p[1] - origins[k, 1], p[2] - origins[k, 2]
                J[0, k], J[1, k], J[2, k] = v * c - w * y, w * x - u * c, u * y - v * x
            # J J' + damping² 1 = L L', then J' (L L')⁻¹ error.
            for i in range(3):
                z[i] = error[i]
                for j in range(i + 1):
                    entry = damping * damping if i == j else 0.0
                    for k in range(5):
                        entry += J[i, k] * J[j, k]
                    for k in range(j):
                        entry -= L[i, k] * L[j, k]
                    L[i, j] = math.sqrt(entry) if i == j else entry / L[j, j]
                for j in range(i):
                    z[i] -= L[i, j] * z[j]
                z[i] /= L[i, i]
            for i in range(2, -1, -1):
                for j in range(i + 1, 3):
                    z[i] -= L[j, i] * z[j]
                z[i] /= L[i, i]
            most = largest
            for k in range(5):
                change[k] = J[0, k] * z[0] + J[1, k] * z[1] + J[2, k] * z[2]
                most = max(most, abs(change[k]))
            for k in range(5):
                moved = q[k] + change[k] / (most / largest)
                q[k] = min(max(moved, limits[0, k]), limits[1, k])
    return left


@compiled
def _look_up(x: float, y: float, z: float, layer: int, grid: GridArrays) -> tuple[np.float32, int]:
    """Distance [m] at a place, and the nearest node, which has to be ready."""
    node = 0
    offs = (np.float32(0.0), np.float32(0.0), np.float32(0.0))
    for axis, place in enumerate((x, y, z)):
        scaled = np.float32(place - grid.lower[axis]) * np.float32(grid.density)
        scaled = min(max(scaled, np.float32(0.0)), np.float32(grid.counts[axis] - 1))
        nearest = np.rint(scaled)
        node = node * grid.counts[axis] + int(nearest)
        offs = (offs[1], offs[2], scaled - nearest)
    distance = grid.table[layer, node, 0]
    for axis, off in enumerate(offs):
        distance += grid.table[layer, node, axis + 1] * off
    return distance, node


@compiled
def looked_up(points: Vector, layers: Numbers, grid: GridArrays) -> tuple[Floats, Numbers]:
    """Distances (M, S) [m] at points (M, S, 3), valid if no nodes (K,) are missing, and these."""
    found = np.empty(points.shape[:2], np.float32)
    missing, count = np.empty(64, np.int64), 0
    for m in range(points.shape[0]):
        for s in range(points.shape[1]):
            x, y, z = points[m, s]
            found[m, s], node = _look_up(x, y, z, layers[s], grid)
            if grid.state[node] == UNKNOWN:
                if count == len(missing):
                    missing = np.concatenate((missing, np.empty_like(missing)))
                missing[count], grid.state[node] = node, ASKED_FOR
                count += 1
    return found, missing[:count]


@compiled
def rate_paths(
    paths: Vector,
    cost: Vector,
    slack: Floats,
    best: Vector,
    chain: ArmChain,
    spheres: Spheres,
    grid: GridArrays,
    numbers: CostNumbers,
) -> Numbers:
    """Rates paths (K, N, 5) whose cost (K,) is NaN; see `TrajectoryCost`.

    A path is left as soon as it is sure to cost more than all of `best`, the least costs so far in
    order: its cost is infinite then. One that needs nodes of the grid that are not ready keeps the
    NaN.

    Returns:
        The nodes (M,) that are missing.
    """
    missing, found = np.empty(64, np.int64), 0
    samples, rows, count = paths.shape[1], chain.rows[5] + 1, len(best)
    weights, spans = numbers.weights, samples - 1.0
    R, p = np.empty((3, 3)), np.empty(3)
    rotations, positions = np.empty((rows, 3, 3)), np.empty((rows, 3))
    axes, origins = np.empty((5, 3)), np.empty((5, 3))
    place = np.empty(3)
    worst = 0  # Where the last path was nearest the next one often is, too.
    for k in range(len(paths)):
        if not math.isnan(cost[k]):
            continue
        path, reference = paths[k], min(k, len(numbers.hand) - 1)
        effort, excess = 0.0, 0.0
        for joint in range(5):
            for n in range(1, samples):
                rate = path[n, joint] - path[n - 1, joint]
                excess = max(excess, abs(rate) / numbers.velocity[joint] * spans)
                if n > 1:
                    bend = rate - (path[n - 1, joint] - path[n - 2, joint])
                    effort += bend * bend
                    needed = abs(bend) / numbers.acceleration[joint] * spans * spans
                    excess = max(excess, math.sqrt(needed))
        base = weights[3] * effort * (spans / numbers.duration) ** 4 / samples
        base += weights[4] * max(excess / numbers.duration - 1.0, 0.0)
        proximity, deviation, most, total = 0.0, 0.0, -np.float32(np.inf), base
        first, is_known = worst, True
        for step in range(samples):
            n = (first + step) % samples
            for i in range(3):
                p[i] = 0.0
                for j in range(3):
                    R[i, j] = 1.0 if i == j else 0.0
            _pose_links(path[n], chain, R, p, rotations, positions, axes, origins)
            for i in range(3):
                deviation += (p[i] - numbers.hand[reference, n, i]) ** 2
            for s in range(len(spheres.link)):
                link = spheres.link[s]
                a, b, c = spheres.centers[s]
                for i in range(3):
                    place[i] = rotations[link, i, 0] * a + rotations[link, i, 1] * b
                    place[i] += rotations[link, i, 2] * c + positions[link, i]
                distance, node = _look_up(place[0], place[1], place[2], spheres.layers[s], grid)
                if grid.state[node] != READY:
                    if grid.state[node] == UNKNOWN:
                        if found == len(missing):
                            missing = np.concatenate((missing, np.empty_like(missing)))
                        missing[found], grid.state[node] = node, ASKED_FOR
                        found += 1
                    is_known = False
                    continue
                lack = numbers.wanted[reference, n, s] - (distance - spheres.radii[s])
                if lack > most:
                    most, worst = lack, n
                if lack > 0.0:
                    lack = lack * np.float32(numbers.density)
                    proximity += lack * lack
            total = base + weights[0] * proximity / samples + weights[2] * deviation / samples
            total += weights[1] * max(most, 0.0)
            if total > best[count - 1]:
                break
        if total > best[count - 1]:
            cost[k] = np.inf
        elif is_known:
            cost[k], slack[k] = total, -most
            rank = count - 1
            while rank > 0 and best[rank - 1] > total:
                best[rank] = best[rank - 1]
                rank -= 1
            best[rank] = total
    return missing[:found]
