"""Several methods on the same problem, over several seeds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pepper_drake.optimization.methods import make_optimizer
from pepper_drake.optimization.problem import Problem
from pepper_drake.optimization.search import search
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Comparison:
    """Results of several methods on one problem.

    Attributes:
        rollouts: (updates + 1,) number of samples evaluated by then.
        costs: By method, the cost (seeds, updates + 1) of its mean after each update.
    """

    rollouts: Array
    costs: dict[str, Array]

    __repr__ = short_repr

    def summary(self) -> dict[str, dict[str, float]]:
        """Returns the quartiles of the last costs by method."""
        return {
            name: dict(
                zip(
                    ("lower_quartile", "median", "upper_quartile"),
                    np.quantile(costs[:, -1], (0.25, 0.5, 0.75)).tolist(),
                    strict=True,
                )
            )
            for name, costs in self.costs.items()
        }


def compare_methods(
    problem: Problem,
    methods: Mapping[str, Mapping[str, Any]],
    *,
    updates: int,
    samples: int,
    seeds: int,
    progress: Callable[[], object] = lambda: None,
) -> Comparison:
    """Searches with each method from each seed.

    A method that converges early keeps its last cost.

    Args:
        problem: What is minimised.
        methods: Settings by method.
        updates: Of each search.
        samples: Of each update.
        seeds: 0 to seeds - 1.
        progress: Called after each search.
    """
    costs = {}
    for name, settings in methods.items():
        rows = []
        for seed in range(seeds):
            optimizer = make_optimizer(name, problem, samples=samples, seed=seed, **settings)
            found = search(problem, optimizer, updates).mean_costs
            rows.append(found + [found[-1]] * (updates + 1 - len(found)))
            progress()
        costs[name] = np.array(rows)
    return Comparison(samples * np.arange(updates + 1.0), costs)
