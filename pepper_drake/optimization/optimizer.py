"""Ask-and-tell interface of every search method."""

from typing import Protocol

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError

Array = npt.NDArray[np.float64]


class Optimizer(Protocol):
    """A search that explores around a mean.

    A method's behaviour follows from its settings, its seed and the costs it was told, in order. So
    a search is saved as what it asked and was told (`history`), and continues bit for bit after
    being told the same again.
    """

    @property
    def mean(self) -> Array:
        """(n,) current mean of the search."""
        ...

    @property
    def deviations(self) -> Array:
        """(n,) standard deviations of the exploration."""
        ...

    @property
    def converged(self) -> bool:
        """True if the exploration no longer changes, and the search may end."""
        ...

    def ask(self) -> Array:
        """Returns (S, n) samples to evaluate; the same until `tell` is called."""
        ...

    def tell(self, costs: Array) -> None:
        """Takes the costs of the samples, (S,) or (S, T), and makes one update."""
        ...


def check_samples(samples: int, least: int = 2) -> None:
    """Raises InputError unless an update has enough samples."""
    if samples < least:
        raise InputError(f"samples: {samples} in each update; use at least {least}")


def check_positive(**values: float) -> None:
    """Raises InputError for the first value that is not a positive number."""
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0.0):
            raise InputError(f"{name}: {value} is not a positive number")


def check_fraction(**values: float) -> None:
    """Raises InputError for the first value that is not above 0 and at most 1."""
    for name, value in values.items():
        if not 0.0 < value <= 1.0:
            raise InputError(f"{name}: {value} is not above 0 and at most 1")
