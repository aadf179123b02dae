"""The same formula for one hand or many: with floats where there is one, else with arrays.

A rollout among obstacles calculates with a few numbers at each step. For those numpy's functions
take several times as long as Python's own.
"""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class Arithmetic(NamedTuple):
    """How to calculate.

    Attributes:
        xp: Has exp, sqrt, minimum, maximum, of numbers (...).
        dot: Product (...) of vectors (..., D).
        scaled: Vectors (..., D) times numbers (...).
        anything: Whether any number (...) is not zero.
    """

    xp: Any
    dot: Callable[[Array, Array], Any]
    scaled: Callable[[Array, Any], Array]
    anything: Callable[[Any], bool]


_ONE = Arithmetic(
    SimpleNamespace(exp=math.exp, sqrt=math.sqrt, minimum=min, maximum=max),
    lambda a, b: float(a.dot(b)),
    lambda vector, number: vector * number,
    bool,
)
_MANY = Arithmetic(
    np,
    lambda a, b: np.einsum("...i,...i->...", a, b),
    lambda vectors, numbers: vectors * numbers[..., None],
    lambda numbers: bool(np.any(numbers)),
)


def arithmetic(state: Array) -> Arithmetic:
    """Returns the fastest way for states (2, D), or (..., 2, D)."""
    return _ONE if state.ndim == 2 else _MANY
