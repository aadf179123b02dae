"""The number of basis functions of a fit, and of the samples that each of them needs."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np
import numpy.typing as npt

T = TypeVar("T")

DEFAULT_NUM_BASIS = 40
"""Basis functions where the data do not ask for another number: some seconds of arm movement."""

_FEWEST_NUM_BASIS, _MOST_NUM_BASIS = 8, 320

_FEWEST_EACH, _FILLED_EACH = 2, 6
"""Samples for each basis function below which the motion between is filled in, and then so densely:
with two that are made up, the last basis functions are weighted beyond measure."""

MOST_SAMPLES = 6000
"""Samples that a fit takes at most."""
COMPARED = 400
"""Places along a motion at which a fit is compared with what was shown."""


def longest_step(times: npt.NDArray[np.float64], num_basis: int) -> float:
    """Returns the longest time between samples with which a number of basis functions is fitted.

    Args:
        times: (N,) of the samples that there are [s].
        num_basis: Number of basis functions.
    """
    share = float(times[-1] - times[0]) / max(num_basis, 1)
    longest = share / _FEWEST_EACH
    return share / _FILLED_EACH if np.any(np.diff(times) > longest) else longest


def choose_num_basis(
    samples: int, learn: Callable[[int], T], deviation: Callable[[T], float], tolerance: float
) -> T:
    """Returns what was learned with a number of basis functions that follows the data.

    Args:
        samples: Number of samples.
        learn: Learns with a number of basis functions.
        deviation: How far what was learned leaves what was shown.
        tolerance: Deviation above which the number is doubled.
    """
    number = min(DEFAULT_NUM_BASIS, max(_FEWEST_NUM_BASIS, samples - 1))
    # Seconds at the usual rates are known to be reproduced by the usual number.
    usual = 2 * DEFAULT_NUM_BASIS <= samples < 8 * DEFAULT_NUM_BASIS
    while True:
        learned = learn(number)
        if usual or 2 * number > _MOST_NUM_BASIS or deviation(learned) <= tolerance:
            return learned
        number *= 2
