"""Compiled costs of the arm's paths: proximity, deviation, effort and duration."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.compiled import compiled
from pepper_drake.planning.collision.compiled_arm import ArmChain
from pepper_drake.planning.collision.compiled_grid import (
    ROUNDING,
    GridArrays,
    Spheres,
    make_ready,
)

Vector = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Numbers = npt.NDArray[np.int64]

_TERMS = 9
"""Terms of the series beside the first."""


class CostNumbers(NamedTuple):
    """Numbers of `TrajectoryCost`.

    Attributes:
        hand: (R, 3, N) hand positions of the references [m]: one for all paths, or one each.
        wanted: (R, S, N) desired clearance of each sphere [m].
        velocity: (5,) velocity limits of the joints [rad/s].
        acceleration: (5,) acceleration limits of the joints [rad/s²].
        duration: Of the paths [s].
        inverse_clearance: 1 / clearance [1/m].
        weights: (5,) of proximity, slack, deviation, effort and duration.
    """

    hand: Vector
    wanted: Floats
    velocity: Vector
    acceleration: Vector
    duration: float
    inverse_clearance: float
    weights: Vector


@compiled
def cos_and_sin(angles: Vector, cos: Vector, sin: Vector) -> None:
    """Fills in cosines and sines (N,) of angles (N,) up to half a turn [rad], to 1e-14.

    Taylor's series of half the angle: the compiler vectorises it, unlike calls of a library.
    """
    for n in range(len(angles)):
        half, c, s = 0.5 * angles[n], 1.0, 1.0
        square = half * half
        for k in range(2 * _TERMS, 0, -2):
            c = 1.0 - square * (1.0 / (k * (k - 1))) * c
            s = 1.0 - square * (1.0 / (k * (k + 1))) * s
        s *= half
        cos[n], sin[n] = 1.0 - 2.0 * s * s, 2.0 * s * c


@compiled
def _pose_path(
    path: Vector, chain: ArmChain, R: Vector, rotations: Vector, positions: Vector
) -> None:
    """Vectorised `link_poses`: each operation runs over N postures (5, N).

    Poses are (L, 3, 3, N) and (L, 3, N), those of the hand last; R (3, 3, N) is workspace.
    """
    count, hand = path.shape[1], chain.rows[5]
    cosine, sine = np.empty(count), np.empty(count)
    p = positions[hand]
    for i in range(3):
        for n in range(count):
            p[i, n] = 0.0
            for j in range(3):
                R[i, j, n] = 1.0 if i == j else 0.0
    for k in range(6):
        x, y, z = chain.positions[k, 0], chain.positions[k, 1], chain.positions[k, 2]
        for i in range(3):
            q, a, b, c = p[i], R[i, 0], R[i, 1], R[i, 2]
            for n in range(count):
                q[n] += a[n] * x + b[n] * y + c[n] * z
            if chain.turned[k]:
                C = chain.rotations[k]
                for n in range(count):
                    u, v, w = a[n], b[n], c[n]
                    a[n] = u * C[0, 0] + v * C[1, 0] + w * C[2, 0]
                    b[n] = u * C[0, 1] + v * C[1, 1] + w * C[2, 1]
                    c[n] = u * C[0, 2] + v * C[1, 2] + w * C[2, 2]
        if k < 5:
            number, sense = chain.axis_numbers[k], chain.senses[k]
            cos_and_sin(path[k], cosine, sine)
            for i in range(3):
                first, second = R[i, (number + 1) % 3], R[i, (number + 2) % 3]
                for n in range(count):
                    u, v, w = first[n], second[n], sense * sine[n]
                    first[n] = u * cosine[n] + v * w
                    second[n] = v * cosine[n] - u * w
        row = chain.rows[k]
        for i in range(3 if row >= 0 else 0):
            for n in range(count):
                positions[row, i, n] = p[i, n]
                for j in range(3):
                    rotations[row, i, j, n] = R[i, j, n]


@compiled
def rate_paths(
    paths: Vector,
    chain: ArmChain,
    spheres: Spheres,
    grid: GridArrays,
    numbers: CostNumbers,
) -> tuple[Vector, Floats]:
    """Rates paths (K, 5, N); see `TrajectoryCost`.

    The inner loops run over the N samples of a path and do little each, so that the compiler can
    vectorise them.

    Args:
        paths: Joint positions [rad].
        chain: Of the arm.
        spheres: On its links.
        grid: Distances in T.
        numbers: Weights, limits, and references of the paths.

    Returns:
        Cost and slack [m] of each path, (K,).
    """
    cost, slack = np.empty(len(paths)), np.empty(len(paths), np.float32)
    samples, rows = paths.shape[2], chain.rows[5] + 1
    weights, spans, ready, table = numbers.weights, samples - 1.0, grid.ready, grid.table
    R, rotations = np.empty((3, 3, samples)), np.empty((rows, 3, 3, samples))
    positions, place = np.empty((rows, 3, samples)), np.empty(samples, np.float32)
    offs, node = np.empty((3, samples), np.float32), np.empty(samples, np.float32)
    index, missing = np.empty(samples, np.int64), np.empty(samples, np.int64)
    density, scale = np.float32(1.0 / grid.spacing), np.float32(numbers.inverse_clearance)
    for k in range(len(paths)):
        reference = min(k, len(numbers.hand) - 1)
        effort, excess = 0.0, 0.0
        for joint in range(5):
            path, fastest, strongest = paths[k, joint], 0.0, 0.0
            for n in range(1, samples):
                rate = path[n] - path[n - 1]
                fastest = max(fastest, abs(rate))
                if n > 1:
                    change = rate - (path[n - 1] - path[n - 2])
                    effort += change * change
                    strongest = max(strongest, abs(change))
            strongest = math.sqrt(strongest / numbers.acceleration[joint]) * spans
            excess = max(excess, fastest / numbers.velocity[joint] * spans, strongest)
        _pose_path(paths[k], chain, R, rotations, positions)
        deviation = 0.0
        for i in range(3):
            own, other = positions[rows - 1, i], numbers.hand[reference, i]
            for n in range(samples):
                deviation += (own[n] - other[n]) ** 2
        proximity, most = 0.0, -np.float32(np.inf)
        for s in range(len(spheres.link)):
            link, layer, radius = spheres.link[s], spheres.layers[s], spheres.radii[s]
            x, y, z = spheres.centers[s, 0], spheres.centers[s, 1], spheres.centers[s, 2]
            for n in range(samples):
                node[n] = 0.0
            for i in range(3):
                p, off = positions[link, i], offs[i]
                a, b, c = rotations[link, i, 0], rotations[link, i, 1], rotations[link, i, 2]
                lower, nodes = grid.lower[i], np.float32(grid.counts[i])
                last = nodes - np.float32(1.0)
                for n in range(samples):
                    place[n] = np.float32(p[n] + (a[n] * x + b[n] * y + c[n] * z) - lower)
                for n in range(samples):
                    scaled = place[n] * density
                    scaled = scaled if scaled > np.float32(0.0) else np.float32(0.0)
                    scaled = scaled if scaled < last else last
                    nearest = (scaled + ROUNDING) - ROUNDING
                    off[n] = scaled - nearest
                    node[n] = node[n] * nodes + nearest
            wanted, u, v, w = numbers.wanted[reference, s], offs[0], offs[1], offs[2]
            rows_of_layer = table[layer]
            count = 0
            for n in range(samples):
                index[n] = number = int(node[n])
                if not ready[number]:
                    missing[count], ready[number] = number, True
                    count += 1
            if count:
                make_ready(missing[:count], grid)
            for n in range(samples):
                number = index[n]
                distance = rows_of_layer[number, 0] + rows_of_layer[number, 1] * u[n]
                distance += rows_of_layer[number, 2] * v[n]
                distance += rows_of_layer[number, 3] * w[n]
                lack = wanted[n] - (distance - radius)
                most = max(most, lack)
                lack = max(lack, np.float32(0.0)) * scale
                proximity += lack * lack
        slack[k] = -most
        cost[k] = weights[0] * proximity / samples + weights[1] * max(most, 0.0)
        cost[k] += weights[2] * deviation / samples
        cost[k] += weights[3] * effort * (spans / numbers.duration) ** 4 / samples
        cost[k] += weights[4] * max(excess / numbers.duration - 1.0, 0.0)
    return cost, slack
