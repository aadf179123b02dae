"""One formula for one hand or many: on floats for a single state, otherwise on arrays.

A rollout among obstacles computes with a few numbers at each step, for which numpy's functions take
several times as long as Python's own.
"""

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Vector = Any  # Three floats of one hand, or an array (..., 3).
Number = Any  # A float, or an array (...).


class Arithmetic(NamedTuple):
    """Vector arithmetic for arrays or floats.

    Attributes:
        xp: Namespace of exp, sqrt, minimum, maximum.
        vector: Makes a vector from an array (..., 3).
        array: Makes an array (..., 3) from a vector.
        dot: Dot product of two vectors.
        plus: `plus(a, b, k)` is a + k b, with a number k.
        times: Vector times a number.
        anything: Whether any number is not zero.
    """

    xp: Any
    vector: Callable[[Array], Vector]
    array: Callable[[Vector], Array]
    dot: Callable[[Vector, Vector], Number]
    plus: Callable[[Vector, Vector, Number], Vector]
    times: Callable[[Vector, Number], Vector]
    anything: Callable[[Number], bool]


def _dot(a: Vector, b: Vector) -> float:
    product: float = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


_ONE = Arithmetic(
    xp=SimpleNamespace(exp=math.exp, sqrt=math.sqrt, minimum=min, maximum=max),
    vector=lambda array: array.tolist(),
    array=np.array,
    dot=_dot,
    plus=lambda a, b, k: (a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]),
    times=lambda a, k: (k * a[0], k * a[1], k * a[2]),
    anything=bool,
)
_MANY = Arithmetic(
    xp=np,
    vector=lambda array: array,
    array=lambda vectors: vectors,
    dot=lambda a, b: np.einsum("...i,...i->...", a, b),
    plus=lambda a, b, k: a + np.asarray(k)[..., None] * b,
    times=lambda a, k: a * k[..., None],
    anything=lambda numbers: bool(np.any(numbers)),
)


def arithmetic(state: Array) -> Arithmetic:
    """Returns the faster arithmetic for states (2, 3), or (..., 2, 3)."""
    return _ONE if state.ndim == 2 else _MANY
