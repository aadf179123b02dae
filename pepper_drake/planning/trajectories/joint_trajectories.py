"""Joint paths from one posture to another, as functions of relative time."""

from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.interpolate import BSpline

Vector = npt.NDArray[np.float64]

_DEGREE = 4


def minimum_jerk(relative_times: Vector) -> Vector:
    """Returns the fraction (N,) travelled at relative times s (N,): 10 s³ - 15 s⁴ + 6 s⁵."""
    s = np.clip(relative_times, 0.0, 1.0)
    return s**3 * (10.0 + s * (6.0 * s - 15.0))


def retarget(paths: Vector, start: Vector, goals: Vector) -> Vector:
    """Returns paths with another start and other goals.

    The demonstrated path q_d becomes q_d + (1 - m) (q_0 - q_d(0)) + m (q_g - q_d(1)), m from
    `minimum_jerk`: both ends are met, at rest if the demonstration was at rest there.

    Args:
        paths: (..., N, 5) at even relative times [rad].
        start: (5,) rad.
        goals: (..., 5) rad.

    Returns:
        (..., N, 5).
    """
    m = minimum_jerk(np.linspace(0.0, 1.0, paths.shape[-2]))[:, None]
    before = (start - paths[..., 0, :])[..., None, :]
    after = (goals - paths[..., -1, :])[..., None, :]
    return paths + (1.0 - m) * before + m * after


def resampled(paths: Vector, samples: int) -> Vector:
    """Resamples paths (..., N, 5) at even times to (..., samples, 5)."""
    place = np.linspace(0.0, paths.shape[-2] - 1, samples)
    before = np.minimum(place.astype(int), paths.shape[-2] - 2)
    share = (place - before)[:, None]
    return (1.0 - share) * paths[..., before, :] + share * paths[..., before + 1, :]


@lru_cache(maxsize=8)
def perturbation_basis(count: int, samples: int) -> Vector:
    """Returns smooth perturbations (samples, count) at even relative times, of peak 1.

    They are B-splines of fourth degree without those that change position, velocity or acceleration
    at the ends, so that a perturbed path keeps its start and goal.
    """
    inner = count + 6 - _DEGREE
    knots = np.concatenate((np.zeros(_DEGREE), np.linspace(0, 1, inner + 1), np.ones(_DEGREE)))
    s = np.linspace(0.0, 1.0, samples)
    values = BSpline.design_matrix(s, knots, _DEGREE).toarray()[:, 3:-3]
    values = np.asarray(values / values.max(axis=0), dtype=np.float64)
    values.setflags(write=False)
    return values


def minimum_duration(paths: Vector, velocity: Vector, acceleration: Vector) -> Vector:
    """Returns the shortest durations (...) [s] to which paths can be scaled within limits.

    Args:
        paths: (..., N, 5) at even relative times [rad].
        velocity: Limits (5,) [rad/s].
        acceleration: Limits (5,) [rad/s²].
    """
    count = paths.shape[-2] - 1
    rates = np.diff(paths, axis=-2)
    speed = (np.abs(rates) / velocity).max(axis=(-2, -1)) * count
    change = (np.abs(np.diff(rates, axis=-2)) / acceleration).max(axis=(-2, -1)) * count**2
    return np.maximum(speed, np.sqrt(change))


def time_parameterize(waypoints: Vector, samples: int) -> Vector:
    """Returns a path (samples, 5) through waypoints (K, 5), K >= 2, at rest at both ends.

    It follows the straight segments with a minimum-jerk profile of the path length; a moving
    average over a tenth of the time then rounds the corners.
    """
    arc = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(waypoints, axis=0), axis=1))))
    travelled = minimum_jerk(np.linspace(0.0, 1.0, samples)) * arc[-1]
    path = np.stack([np.interp(travelled, arc, column) for column in waypoints.T], axis=1)
    return smoothed(path)


def smoothed(path: Vector) -> Vector:
    """Rounds the corners of a path (N, 5) by a moving average over a tenth of it, same ends."""
    half = max(len(path) // 20, 1)
    padded = np.concatenate((np.repeat(path[:1], half, 0), path, np.repeat(path[-1:], half, 0)))
    sums = np.cumsum(np.concatenate((np.zeros((1, 5)), padded)), axis=0)
    mean = (sums[2 * half + 1 :] - sums[: -2 * half - 1]) / (2 * half + 1)
    return retarget(mean, path[0], path[-1])


class Retrace:
    """Joint trajectory from a posture back along a demonstration to its first posture.

    The arm moves straight to the nearest posture of the demonstration, then backwards through some
    of its postures (not all: a limp elbow swings), with a `minimum_jerk` profile.

    Attributes:
        duration: [s].
    """

    def __init__(
        self, joints: Vector, demonstrated: Vector, *, speed: float = 1.0, stride: int = 20
    ) -> None:
        """Makes the path.

        Args:
            joints: Present joints (5,) [rad].
            demonstrated: The demonstration's joints (N, 5) [rad].
            speed: Mean speed of the joint that moves farthest [rad/s].
            stride: Number of the demonstration's samples between the postures.
        """
        nearest = int(np.argmin(np.abs(demonstrated - joints).max(axis=1)))
        self._postures = np.concatenate(
            (joints[None], demonstrated[nearest:0:-stride], demonstrated[:1])
        )
        steps = np.abs(np.diff(self._postures, axis=0)).max(axis=1)
        self._lengths = np.concatenate(([0.0], np.cumsum(steps)))
        self.duration = max(float(self._lengths[-1]) / speed, 0.5)

    def at(self, time: float) -> Vector:
        """Returns the joints (5,) [rad] at a time [s]; the ends before and after it."""
        share = minimum_jerk(np.array([time / self.duration]))[0]
        arc = self._lengths[-1] * share
        return np.array([np.interp(arc, self._lengths, column) for column in self._postures.T])
