"""RRT-Connect: a way for the arm where bending a demonstration finds none.

Kuffner and LaValle 2000, doi:10.1109/ROBOT.2000.844730. Whole motions are checked at once, which
for a check that is arithmetic on arrays is many times as fast as one posture after the other, and
the random numbers are the call's own: the same call finds the same way.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Vector = npt.NDArray[np.float64]
Free = Callable[[Vector], npt.NDArray[np.bool_]]
"""Says which of some postures (M, 5) are free, (M,)."""


@dataclass
class RrtConnectParams:
    """Size of the search."""

    samples: int = 800
    """Random postures at most."""
    step: float = 0.4
    """Longest motion by which a tree grows at once [rad]."""
    resolution: float = 0.05
    """Between the postures that are checked along a motion [rad]."""
    shortcuts: int = 60
    """Attempts to shorten the path that was found."""


class _Tree:
    """Postures, and from which other each was reached."""

    def __init__(self, roots: Vector) -> None:
        self.postures = [*roots]
        self.parents = [-1] * len(roots)

    def nearest(self, posture: Vector) -> int:
        return int(np.argmin(np.sum((np.array(self.postures) - posture) ** 2, axis=1)))

    def add(self, posture: Vector, parent: int) -> int:
        self.postures.append(posture)
        self.parents.append(parent)
        return len(self.postures) - 1

    def way(self, index: int) -> list[Vector]:
        """From a posture back to the root."""
        postures = []
        while index >= 0:
            postures.append(self.postures[index])
            index = self.parents[index]
        return postures


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
        start: (5,) rad; taken to be free.
        goals: (G, 5) rad; taken to be free.
        free: Says which postures are free.
        lower: (5,) of what is searched [rad].
        upper: (5,) rad.
        params: How long to search.
        seed: Of the random numbers.

    Returns:
        Corners (K, 5) of a shortened path [rad]; None if none was found.
    """
    rng = np.random.default_rng(seed)

    def clear(one: Vector, other: Vector) -> bool:
        count = int(np.ceil(np.abs(other - one).max() / params.resolution))
        shares = np.arange(1, count)[:, None] / max(count, 1)
        return count < 2 or bool(free(one + shares * (other - one)).all())

    def extend(tree: _Tree, target: Vector) -> tuple[int, bool] | None:
        """Grows a tree by one motion: the new posture, and whether it is the target."""
        index = tree.nearest(target)
        near = tree.postures[index]
        length = float(np.linalg.norm(target - near))
        there = length <= params.step
        following = target if there else near + params.step / length * (target - near)
        if not free(following[None])[0] or not clear(near, following):
            return None
        return tree.add(following, index), there

    trees = [_Tree(start[None]), _Tree(goals)]
    for number in range(params.samples):
        growing, other = trees[number % 2], trees[1 - number % 2]
        grown = extend(growing, rng.uniform(lower, upper))
        if grown is None:
            continue
        target = growing.postures[grown[0]]
        reached = extend(other, target)
        while reached is not None and not reached[1]:
            reached = extend(other, target)
        if reached is not None:
            from_start, from_goal = (
                (growing.way(grown[0]), other.way(reached[0]))
                if number % 2 == 0
                else (other.way(reached[0]), growing.way(grown[0]))
            )
            path = np.array(from_start[::-1] + from_goal[1:])
            return _shortened(path, clear, rng, params.shortcuts)
    return None


def _shortened(
    path: Vector,
    clear: Callable[[Vector, Vector], bool],
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
        if clear(a, b):
            path = np.concatenate((path[:i], [a, b], path[j:]))
    return path
