"""The one interface of all searches: numbers in, costs out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]

Evaluate = Callable[[Array], npt.ArrayLike]
"""Parameters (S, n) to costs (S,), or to costs (S, T) of each step, whose sum counts."""


@dataclass(frozen=True, eq=False)
class Problem:
    """A minimisation problem.

    Attributes:
        guess: (n,) where the search starts.
        exploration: Standard deviation with which a search starts, in the parameters' own unit:
            the root of r in equation 3.2.
        evaluate: The cost of many parameters. It must not depend on which others are beside them.
        chunk: How many parameters one call takes. Work is cut in the same way whoever does it, so
            that one core and a cluster give the same costs to the last bit.
        features: `features(T)` (T, R): what the parameters of one coordinate act through at T
            steps, where the policy is linear in them (equation D.4). The parameters, as a matrix
            (R, coordinates), then have one row for each feature.
    """

    guess: Array
    exploration: float
    evaluate: Evaluate
    chunk: int = 1
    features: Callable[[int], Array] | None = None

    __repr__ = short_repr


def total_costs(costs: Array) -> Array:
    """Returns costs (S,) of costs (S,) or of costs (S, T) of each step."""
    return costs if costs.ndim == 1 else costs.sum(axis=1)


def costs_to_go(costs: Array) -> Array:
    """Returns (S, T): what each rollout still costs from each step on; T is 1 for costs (S,)."""
    if costs.ndim == 1:
        return costs[:, None]
    return np.cumsum(costs[:, ::-1], axis=1)[:, ::-1]
