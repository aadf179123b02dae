"""RRT-Connect: the arm's path planner for scenes in which no deformed demonstration is clear.

Kuffner and LaValle 2000, doi:10.1109/ROBOT.2000.844730. A tree grows towards a batch of random
postures at a time, whose motions are checked in one vectorised call: many times as fast as one by
one. The random numbers are seeded in each call: equal calls find equal paths.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Free = Callable[[Vector], Mask]
"""Tells which postures (M, 5) are free, (M,)."""


@dataclass
class RrtConnectParams:
    """Size of the search."""

    samples: int = 9600
    """Largest number of random postures."""
    batch: int = 96
    """Random postures per batch."""
    step: float = 0.4
    """Longest motion between two postures of a tree [rad]."""
    resolution: float = 0.05
    """Largest joint motion between the checked postures of a motion [rad]."""
    shortcuts: int = 60
    """Attempts to shorten the path."""


class _Tree:
    """Postures (N, 5) and their parents."""

    def __init__(self, roots: Vector) -> None:
        self.postures = roots
        self._parents = np.full(len(roots), -1)

    def nearest(self, targets: Vector) -> npt.NDArray[np.intp]:
        """Returns the indices (M,) of the postures nearest to targets (M, 5)."""
        squares = np.sum(self.postures**2, axis=1)
        return np.argmin(squares - 2.0 * targets @ self.postures.T, axis=1)

    def add(self, postures: Vector, parents: npt.NDArray[np.intp]) -> None:
        self.postures = np.concatenate((self.postures, postures))
        self._parents = np.concatenate((self._parents, parents))

    def path(self, index: int) -> Vector:
        """Returns the postures (K, 5) from the root to a posture."""
        indices = []
        while index >= 0:
            indices.append(index)
            index = int(self._parents[index])
        return self.postures[indices[::-1]]


def rrt_connect(
    start: Vector,
    goals: Vector,
    free: Free,
    *,
    lower: Vector,
    upper: Vector,
    params: RrtConnectParams,
    seed: int = 0,
) -> Vector | None:
    """Plans from a posture to one of several others.

    Args:
        start: (5,) [rad]; assumed to be free.
        goals: (G, 5) [rad]; assumed to be free.
        free: Tells which postures are free.
        lower: (5,) lower bounds of the searched postures [rad].
        upper: (5,) upper bounds [rad].
        params: Size of the search.
        seed: Seed of the random numbers.

    Returns:
        Corners (K, 5) of a shortened path [rad]; None if none was found.
    """
    rng = np.random.default_rng(seed)

    def clear(ones: Vector, others: Vector) -> Mask:
        """Tells which straight motions between postures (M, 5) are free."""
        count = int(np.ceil(np.abs(others - ones).max(initial=0.0) / params.resolution))
        if count < 2 or not len(ones):
            return np.ones(len(ones), dtype=bool)
        shares = np.arange(1, count)[:, None, None] / count
        between = ones + shares * (others - ones)
        is_free = free(between.reshape(-1, len(start))).reshape(count - 1, -1)
        return np.asarray(is_free.all(axis=0))

    def extend(tree: _Tree, targets: Vector) -> tuple[npt.NDArray[np.intp], Vector, Mask]:
        """Grows a tree by one motion towards each target (M, 5).

        Returns:
            Indices of the targets towards which it grew, the new postures, and whether each is its
            target.
        """
        parents = tree.nearest(targets)
        near = tree.postures[parents]
        off = targets - near
        length = np.linalg.norm(off, axis=1, keepdims=True)
        there = length[:, 0] <= params.step
        ends = np.where(
            there[:, None], targets, near + params.step / np.maximum(length, 1e-9) * off
        )
        grown = np.flatnonzero(free(ends))
        grown = grown[clear(near[grown], ends[grown])]
        tree.add(ends[grown], parents[grown])
        return grown, ends[grown], there[grown]

    trees = [_Tree(start[None]), _Tree(goals)]
    for number in range(-(-params.samples // params.batch)):
        growing, other = trees[number % 2], trees[1 - number % 2]
        _, targets, _ = extend(growing, rng.uniform(lower, upper, (params.batch, len(start))))
        # The other tree grows towards each of these until it is blocked.
        indices = np.arange(len(growing.postures) - len(targets), len(growing.postures))
        while len(targets):
            kept, _, there = extend(other, targets)
            if there.any():
                first = int(np.argmax(there))
                meeting = (
                    growing.path(int(indices[kept[first]])),
                    other.path(len(other.postures) - len(kept) + first),
                )
                ahead, behind = meeting if number % 2 == 0 else meeting[::-1]
                path = np.concatenate((ahead, behind[-2::-1]))
                return _shortened(path, clear, rng, params.shortcuts)
            targets, indices = targets[kept], indices[kept]
    return None


def _shortened(
    path: Vector,
    clear: Callable[[Vector, Vector], Mask],
    rng: np.random.Generator,
    attempts: int,
) -> Vector:
    """Replaces parts of a path by straight motions between random points of it."""
    for _ in range(attempts):
        if len(path) < 3:
            break
        way = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))))
        first, last = np.sort(rng.uniform(0.0, way[-1], 2))
        i, j = np.searchsorted(way, [first, last], side="right")
        if i == j:
            continue
        a, b = (
            path[k - 1] + (at - way[k - 1]) / (way[k] - way[k - 1]) * (path[k] - path[k - 1])
            for k, at in ((i, first), (min(j, len(path) - 1), last))
        )
        if clear(a[None], b[None])[0]:
            path = np.concatenate((path[:i], [a, b], path[j:]))
    return path
