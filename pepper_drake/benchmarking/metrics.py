"""Metrics of one hand path: length, smoothness, and distance to the demonstration."""

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.signal import savgol_filter

from pepper_drake.evaluation.approximator_comparison import trajectory_distance
from pepper_drake.learning import MovementPrimitive

Array = npt.NDArray[np.float64]

_WINDOW, _ORDER = 15, 5
"""Window of the local polynomials whose third derivative is the jerk: 0.15 s at 100 Hz."""


def path_length(positions: Array) -> float:
    """Returns the length of a path through positions (N, 3) [m]."""
    return float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())


def rms_jerk(positions: Array, time_step: float) -> float:
    """Returns the root mean square of the jerk of a path (N, 3) [m/s³].

    The jerk is the third derivative of local polynomials (Savitzky and Golay 1964); NaN if the path
    has too few samples for them.
    """
    if len(positions) < _WINDOW:
        return float("nan")
    jerk = savgol_filter(positions, _WINDOW, _ORDER, deriv=3, delta=time_step, axis=0)
    return float(np.sqrt(np.mean(np.sum(jerk**2, axis=1))))


def demonstration_distance(
    primitive: MovementPrimitive, positions: Array, duration: float, time_step: float = 0.01
) -> float:
    """Returns the distance [m] of a path to the demonstration, equation 4.1.

    The demonstrated movement is rolled out from the path's start to its end, without obstacles.
    Both paths are compared at equal fractions of their durations, with the number of samples that
    the demonstration has at that time step. Positions after `duration` are ignored.

    Args:
        primitive: Primitive of the demonstration.
        positions: (N, 3) of the hand, from the arm's start [m].
        duration: Duration of the movement [s], without the rest after it.
        time_step: Time step of the positions [s].
    """
    count = round(primitive.duration / time_step) + 1
    fractions = np.linspace(0.0, 1.0, count)
    undisturbed = primitive.rollout(
        time_step=primitive.duration / (count - 1),
        start=positions[0],
        goal=positions[-1],
        start_velocity=np.zeros(3),
    )
    reference = undisturbed.times / undisturbed.times[-1]
    performed = np.arange(len(positions)) * time_step / duration
    return trajectory_distance(
        _at(fractions, reference, undisturbed.positions), _at(fractions, performed, positions)
    )


def _at(fractions: npt.NDArray[Any], own_fractions: npt.NDArray[Any], positions: Array) -> Array:
    return np.stack([np.interp(fractions, own_fractions, column) for column in positions.T], axis=1)
