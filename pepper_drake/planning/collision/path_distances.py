"""Distances along a path of postures, of which only those that matter are measured."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.planning.collision.arm_kinematics import ArmKinematics, ArmPoses

Vector = npt.NDArray[np.float64]

_STRIDE = 4
"""Stride of the postures that are measured first."""


class PathDistances(NamedTuple):
    """Distances at some postures of a path, among which is the nearest.

    Attributes:
        indices: Indices (M,) of the postures, ascending.
        distances: (M,) [m].
    """

    indices: npt.NDArray[np.int64]
    distances: Vector

    @property
    def minimum(self) -> float:
        """The least distance of the path [m]."""
        return float(self.distances.min())


def path_distances(
    measure: Callable[[Vector], Vector], path: Vector, motion: Vector, below: float = np.inf
) -> PathDistances:
    """Measures distances along a path so that the least of them is that of all postures.

    From one posture to the next no distance changes by more than the arm moves. Every fourth is
    measured, then those in between where a distance may be less than these.

    Args:
        measure: Returns distances (M,) of postures (M, n) [m].
        path: Postures (N, n) [rad].
        motion: How far the arm moves from each posture to the next (N - 1,) [m]; see `arm_motion`.
        below: A minimum above this need not be exact [m].
    """
    last = len(path) - 1
    ends = np.unique(np.append(np.arange(0, last, _STRIDE), last))
    coarse = measure(path[ends])
    travelled = np.concatenate(([0.0], np.cumsum(motion)))[ends]
    # Between distances a and b, a motion of s apart, there is none less than (a + b - s) / 2.
    lowest = 0.5 * (coarse[:-1] + coarse[1:] - np.diff(travelled))
    between = np.flatnonzero(lowest < min(float(coarse.min()), below))
    inner = np.concatenate([ends[:0], *(np.arange(ends[k] + 1, ends[k + 1]) for k in between)])
    if not len(inner):
        return PathDistances(ends, coarse)
    indices = np.concatenate((ends, inner))
    order = np.argsort(indices)
    return PathDistances(indices[order], np.concatenate((coarse, measure(path[inner])))[order])


def arm_motion(kinematics: ArmKinematics, poses: ArmPoses) -> Vector:
    """Returns how far the spheres of an arm move at most between postures of a path (N - 1,) [m].

    Args:
        kinematics: Kinematics of the arm.
        poses: Poses of the path's N postures.
    """
    steps = np.diff(kinematics.sphere_centers(poses), axis=0)
    return np.asarray(np.sqrt(np.einsum("nsi,nsi->ns", steps, steps).max(axis=1, initial=0.0)))
