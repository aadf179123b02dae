"""Episodic natural actor-critic: eNAC, equations D.1 to D.3.

Peters and Schaal, "Natural Actor-Critic", Neurocomputing 71, 2008.
"""

import numpy as np
import numpy.typing as npt

from pepper_drake.optimization.gaussian_search import GaussianSearch
from pepper_drake.optimization.optimizer import check_fraction, check_positive
from pepper_drake.optimization.problem import Problem, total_costs

Array = npt.NDArray[np.float64]


class EpisodicNaturalActorCritic(GaussianSearch):
    """Follows the natural gradient that a least-squares critic estimates from whole rollouts.

    The policy explores with parameters theta + eps, eps of N(0, Sigma), held over a rollout. Then

        grad log pi = Sigma^-1 eps,    G = E[grad log pi grad log pi'] = Sigma^-1 (D.2).

    Critic: with compatible features, LSTD-Q(1) over whole episodes is the linear regression of the
    returns R_h (minus the costs) on them and a constant, R_h = J + (grad log pi_h)' w; its w is the
    natural gradient G^-1 grad J (D.1). With fewer rollouts than parameters it is the minimum-norm
    solution in the metric G, which leaves unexplored directions alone.

    Actor: theta <- theta + alpha w (D.3), with alpha such that the step has a length of `step`
    standard deviations of the exploration in the metric G; so the units of the cost do not matter.
    The exploration shrinks by a factor with each update, and the steps with it.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        samples: int = 10,
        seed: int = 0,
        rate: float | None = None,
        step: float = 4.0,
        decay: float = 0.9,
        threshold: float = 1e-8,
    ) -> None:
        """Starts at the problem's guess.

        Args:
            problem: What is minimised.
            samples: Rollouts of each update.
            seed: Of the exploration.
            rate: Initial variance of the exploration; the problem's if left out.
            step: Length of a step in standard deviations of the exploration.
            decay: Of the standard deviation at each update, above 0 and at most 1.
            threshold: It has converged when the variance changes by less than this share of the
                first.

        Raises:
            InputError: A setting is out of range.
        """
        super().__init__(problem, samples=samples, seed=seed, rate=rate)
        check_positive(step=step)
        check_fraction(decay=decay)
        self._step, self._decay, self._threshold = step, decay, threshold

    @property
    def deviations(self) -> Array:
        """(n,) standard deviations of the exploration."""
        return np.full(len(self._mean), np.sqrt(self._rate) * self._decay**self._update)

    @property
    def converged(self) -> bool:
        """True if the last update changed the exploration by less than the threshold."""
        if self._update == 0:
            return False
        now = self._decay ** (2 * self._update)
        return abs(now - now / self._decay**2) < self._threshold

    def tell(self, costs: Array) -> None:
        """Takes one step along the natural gradient."""
        explored = self.ask() - self._mean
        deviations = self.deviations
        gradient = natural_gradient(explored, -total_costs(np.asarray(costs)), deviations)
        length = float(np.linalg.norm(gradient / deviations))
        if length > 0.0:
            self._mean = self._mean + self._step / length * gradient
        self._update += 1


def natural_gradient(explored: Array, returns: Array, deviations: Array) -> Array:
    """Returns w (n,) of the critic's regression.

    Args:
        explored: (S, n) exploration noise: each rollout's parameters minus theta.
        returns: (S,).
        deviations: (n,) standard deviations of the exploration.
    """
    # With u = w / sigma the regression is R = J + (eps / sigma)' u, and |u| is the norm in G. All
    # is centred, which eliminates the constant J.
    scores = explored / deviations
    centred = scores - scores.mean(axis=0)
    slope = np.linalg.lstsq(centred, returns - returns.mean(), rcond=1e-10)[0]
    return np.asarray(slope * deviations)
