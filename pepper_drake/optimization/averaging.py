"""Reward-weighted averaging: the report's algorithm 3, equations 3.1 and 3.2."""

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.optimization.gaussian_search import GaussianSearch
from pepper_drake.optimization.optimizer import check_fraction, check_positive
from pepper_drake.optimization.problem import Problem, total_costs
from pepper_drake.optimization.weighting import ELITENESS, best, exponential_weights

Array = npt.NDArray[np.float64]

DECAY = 0.7
"""Default of d in equation 3.2: after seven updates the exploration is a twelfth."""

LAST_EXPLORATION = 0.03
"""Share that `decay_over` leaves of the first exploration's standard deviation."""


def decay_over(updates: int) -> float:
    """Returns the d of equation 3.2 that leaves `LAST_EXPLORATION` after some updates."""
    return float(LAST_EXPLORATION ** (1.0 / max(1, updates)))


class RewardWeightedAveraging(GaussianSearch):
    """Algorithm 3: lambda samples of N(theta, Sigma), of which the best mu are averaged.

    - Their costs are normalised, so that the best has 0 and the worst of all samples -h;
      w_i = exp(c_i), and theta is the average of the samples with these weights (3.1).
    - Sigma = r I at first; after each update it is multiplied by d² (3.2).
    - It has converged when Sigma and its predecessor differ by less than a threshold, as matrices
      (root of the sum of squares), relative to the first Sigma.

    The report leaves the normalisation open. This is that of the library it used: without h (called
    eliteness there) the best sample would weigh only e times as much as the worst.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        samples: int = 10,
        seed: int = 0,
        rate: float | None = None,
        decay: float = DECAY,
        elite: int | None = None,
        eliteness: float = ELITENESS,
        threshold: float = 1e-8,
    ) -> None:
        """Starts at the problem's guess.

        Args:
            problem: What is minimised.
            samples: lambda, of each update.
            seed: Of the samples.
            rate: r, the initial variance of the exploration; the problem's if left out.
            decay: d, above 0 and at most 1.
            elite: mu, how many of the samples count; all if left out.
            eliteness: h.
            threshold: Of convergence.

        Raises:
            InputError: A setting is out of range.
        """
        super().__init__(problem, samples=samples, seed=seed, rate=rate)
        elite = samples if elite is None else elite
        check_positive(eliteness=eliteness)
        check_fraction(decay=decay)
        if not 1 <= elite <= samples:
            raise InputError(f"elite: {elite} of {samples} samples; use 1 to {samples}")
        self._decay, self._elite, self._eliteness = decay, elite, eliteness
        self._threshold = threshold

    @property
    def variance(self) -> float:
        """Sigma's diagonal: r d^(2 k) after k updates."""
        return float(self._rate * self._decay ** (2 * self._update))

    @property
    def deviations(self) -> Array:
        """(n,) standard deviations of the exploration."""
        return np.full(len(self._mean), np.sqrt(self.variance))

    @property
    def converged(self) -> bool:
        """True if the last update changed Sigma by less than the threshold."""
        if self._update == 0:
            return False
        # Both are multiples of the identity, whose norm cancels.
        before = self.variance / self._decay**2
        return abs(self.variance - before) < self._threshold * self._rate

    def tell(self, costs: Array) -> None:
        """Moves theta to the weighted average of the mu best, and makes Sigma smaller."""
        totals = total_costs(np.asarray(costs, dtype=float))
        self._mean = averaged(self.ask(), totals, self._elite, self._eliteness)
        self._update += 1


def averaged(samples: Array, costs: Array, elite: int, eliteness: float) -> Array:
    """Returns equation 3.1: the mean (n,) of the best samples, weighted by their costs.

    Args:
        samples: (S, n).
        costs: (S,).
        elite: mu, how many count.
        eliteness: h, the size of the worst of the normalised costs.
    """
    chosen = best(costs, elite)
    weights = exponential_weights(costs, eliteness)[chosen]
    return np.asarray(weights @ samples[chosen] / weights.sum())
