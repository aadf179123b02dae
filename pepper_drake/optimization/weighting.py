"""From costs to weights: cheaper samples weigh more."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

ELITENESS = 10.0
"""Exponent of the weights of a normalised batch: the best weighs exp(10) times the worst."""


def normalized(costs: Array, axis: int = 0) -> Array:
    """Returns the costs on a scale from -1 (the worst) to 0 (the best); 0 where all are equal.

    It is the "normalize" of algorithm 3, with the sign with which exp(c) of equation 3.1 prefers
    low costs. It is invariant to shift and scale of the costs.
    """
    least, most = costs.min(axis=axis, keepdims=True), costs.max(axis=axis, keepdims=True)
    spread = most - least
    return np.where(spread > 0.0, (least - costs) / np.where(spread > 0.0, spread, 1.0), 0.0)


def exponential_weights(costs: Array, eliteness: float = ELITENESS, axis: int = 0) -> Array:
    """Returns weights exp(h c) of normalised costs c, h the eliteness; they add up to one."""
    weights = np.exp(eliteness * normalized(costs, axis))
    return np.asarray(weights / weights.sum(axis=axis, keepdims=True))


def best(costs: Array, count: int) -> npt.NDArray[np.intp]:
    """Returns the indices of the cheapest samples, in order; of equal ones the earlier first."""
    return np.argsort(costs, kind="stable")[:count]
