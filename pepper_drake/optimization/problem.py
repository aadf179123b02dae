"""The common interface of all searches: parameters in, costs out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]

Evaluate = Callable[[Array], npt.ArrayLike]
"""Parameters (S, n) to costs (S,), or to costs (S, T) of each step, which are summed."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A minimisation problem.

    Attributes:
        guess: (n,) start of the search.
        exploration: Initial standard deviation of a search, in the parameters' unit: the root of r
            in equation 3.2.
        evaluate: Costs of many parameters. Each must not depend on the others of the call.
        chunk: Number of parameters per call. Work is split the same way everywhere, so that one
            core and a cluster give the same costs to the last bit.
        features: `features(T)` (T, R): the policy's features at T steps, if it is linear in the
            parameters (equation D.4). The parameters, as a matrix (R, coordinates), then have one
            row per feature.
    """

    guess: Array
    exploration: float
    evaluate: Evaluate
    chunk: int = 1
    features: Callable[[int], Array] | None = None

    __repr__ = short_repr


def total_costs(costs: Array) -> Array:
    """Returns total costs (S,) from costs (S,), or (S, T) of each step."""
    return costs if costs.ndim == 1 else costs.sum(axis=1)


def costs_to_go(costs: Array) -> Array:
    """Returns (S, T): the cost-to-go of each rollout from each step on; T is 1 for costs (S,)."""
    if costs.ndim == 1:
        return costs[:, None]
    return np.cumsum(costs[:, ::-1], axis=1)[:, ::-1]
