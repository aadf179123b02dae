"""Matrices that depend on the times of samples alone, kept for the next motion with the same."""

from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_interp_spline

Array = npt.NDArray[np.float64]

MOST_CACHED = 256
"""Most samples of a motion for which matrices are kept."""


_GRID = 2.0**44
"""Steps of the grid on which relative times are keys, in the motion's length."""


class TimesKey:
    """Relative times, rounded to a grid of 6e-14 of the motion's length, as a key.

    What is computed from a key uses its rounded times: with those of the motion that came first,
    a result would depend on what was computed before it.
    """

    def __init__(self, times: Array) -> None:
        rounded = np.round(times * _GRID)
        self.times = rounded / _GRID
        self._key = rounded.tobytes()

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, TimesKey) and self._key == other._key


def spline_derivatives(relative_times: Array, values: Array) -> tuple[Array, Array]:
    """Returns first and second derivatives (N, D) of the quintic spline through values (N, D).

    Of few samples the spline is cubic. The spline is linear in the values: up to 256 samples the
    matrices are kept, which saves the solution of its equations for the next motion.

    Args:
        relative_times: (N,) from 0 to 1.
        values: (N, D).
    """
    if len(relative_times) > MOST_CACHED:
        first, second = _derivatives(relative_times, values)
        return first, second
    first, second = _derivative_matrices(TimesKey(relative_times))
    return first @ values, second @ values


@lru_cache(maxsize=16)
def _derivative_matrices(times: TimesKey) -> Array:
    matrices = _derivatives(times.times, np.eye(len(times.times)))
    matrices.setflags(write=False)
    return matrices


def _derivatives(times: Array, values: Array) -> Array:
    spline = make_interp_spline(times, values, k=5 if len(times) > 5 else 3)
    return np.stack((spline.derivative(1)(times), spline.derivative(2)(times)))
