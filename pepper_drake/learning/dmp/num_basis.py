"""The number of basis functions of a fit, and the number of samples that each needs."""

from collections.abc import Callable
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError

T = TypeVar("T")

DEFAULT_NUM_BASIS = 40
"""Default number of basis functions, for some seconds of arm movement."""

_FEWEST_NUM_BASIS, _MOST_NUM_BASIS = 8, 320

_MOST_GIVEN = 1000
"""Largest number that may be given: the memory of a fit grows with its square, 200 MB at this."""

_FEWEST_EACH, _FILLED_EACH = 2, 6
"""With fewer samples per basis function than the first, samples are interpolated to the density of
the second: with only two interpolated ones, the weights of the last basis functions diverge."""

MOST_SAMPLES = 6000
"""Largest number of samples of a fit."""
COMPARED = 400
"""Number of points at which a fit is compared with its demonstration."""


def check_num_basis(num_basis: int, name: str = "num_basis", least: int = 1) -> None:
    """Checks a number of basis functions that was given.

    Args:
        num_basis: The number.
        name: Its name in the message.
        least: The least that can be used.

    Raises:
        InputError: There are too few or too many.
    """
    if not least <= num_basis <= _MOST_GIVEN:
        raise InputError(
            f"{name}: {num_basis} basis functions; use at least {least} and at most {_MOST_GIVEN}"
        )


def longest_step(times: npt.NDArray[np.float64], num_basis: int) -> float:
    """Returns the longest time between samples with which so many basis functions are fitted.

    Args:
        times: (N,) of the recorded samples [s].
        num_basis: Number of basis functions.
    """
    share = float(times[-1] - times[0]) / max(num_basis, 1)
    longest = share / _FEWEST_EACH
    return share / _FILLED_EACH if np.any(np.diff(times) > longest) else longest


def choose_num_basis(
    samples: int, learn: Callable[[int], T], deviation: Callable[[T], float], tolerance: float
) -> T:
    """Returns the result of learning with a number of basis functions that suits the data.

    Args:
        samples: Number of samples.
        learn: Learns with a number of basis functions.
        deviation: Deviation of a learned motion from the demonstration.
        tolerance: Deviation above which the number is doubled.
    """
    number = min(DEFAULT_NUM_BASIS, max(_FEWEST_NUM_BASIS, samples - 1))
    # For some seconds at usual rates the default number is known to suffice.
    usual = 2 * DEFAULT_NUM_BASIS <= samples < 8 * DEFAULT_NUM_BASIS
    while True:
        learned = learn(number)
        if usual or 2 * number > _MOST_NUM_BASIS or deviation(learned) <= tolerance:
            return learned
        number *= 2
