"""Path integrals with covariance adaptation: PI2-CMA.

Stulp and Sigaud, "Path Integral Policy Improvement with Covariance Matrix Adaptation", ICML 2012.
"""

import numpy as np
import numpy.typing as npt

from pepper_drake.optimization.gaussian_search import GaussianSearch
from pepper_drake.optimization.optimizer import check_fraction, check_positive
from pepper_drake.optimization.problem import Problem, costs_to_go
from pepper_drake.optimization.weighting import ELITENESS, exponential_weights

Array = npt.NDArray[np.float64]


class Pi2Cma(GaussianSearch):
    """PI2 whose exploration adapts to the samples of low cost.

    With S_ik the cost-to-go of sample k from step i on, and N steps,

        P_ik = exp(-h (S_ik - min_k S_ik) / (max_k S_ik - min_k S_ik)) / sum over k of the same,
        theta_i = sum_k P_ik theta_k,
        Sigma_i = sum_k P_ik (theta_k - theta) (theta_k - theta)',
        theta <- sum_i (N - i) theta_i / sum_i (N - i), and Sigma likewise:

    temporal averaging, in which early steps count more, as more depends on them. All is linear in
    P, so it reduces to one weight per sample. For costs without steps N is 1.

    A few samples do not determine most directions: Sigma moves to the new one by a learning rate (1
    in the paper), and its eigenvalues are kept above a share of the initial ones, as in the paper,
    to keep exploring.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        samples: int = 10,
        seed: int = 0,
        rate: float | None = None,
        eliteness: float = ELITENESS,
        learning_rate: float = 0.8,
        least: float = 1e-6,
        threshold: float = 1e-8,
    ) -> None:
        """Starts at the problem's guess with Sigma = r I.

        Args:
            problem: What is minimised.
            samples: Of each update.
            seed: Of the samples.
            rate: r, the initial variance of the exploration; the problem's if left out.
            eliteness: h.
            learning_rate: Of Sigma, above 0 and at most 1.
            least: The smallest eigenvalue of Sigma, as a share of r.
            threshold: It has converged when an update changes Sigma by less than this, relative
                to the first Sigma.

        Raises:
            InputError: A setting is out of range.
        """
        super().__init__(problem, samples=samples, seed=seed, rate=rate)
        check_positive(eliteness=eliteness, least=least)
        check_fraction(learning_rate=learning_rate)
        self._covariance = self._rate * np.eye(len(self._mean))
        self._root = np.sqrt(self._covariance)
        self._eliteness = eliteness
        self._learning_rate, self._least = learning_rate, least * self._rate
        self._threshold = threshold * float(np.linalg.norm(self._covariance))
        self._change = np.inf

    @property
    def covariance(self) -> Array:
        """(n, n) Sigma."""
        return self._covariance

    @property
    def deviations(self) -> Array:
        """(n,) standard deviations of the exploration."""
        return np.sqrt(np.diagonal(self._covariance))

    @property
    def converged(self) -> bool:
        """True if the last update changed Sigma by less than the threshold."""
        return self._change < self._threshold

    def _spread(self, noise: Array) -> Array:
        return noise @ self._root

    def tell(self, costs: Array) -> None:
        """Updates theta and Sigma."""
        samples = self.ask()
        weights = path_integral_weights(np.asarray(costs, dtype=float), self._eliteness)
        seen = weighted_covariance(samples, weights, self._mean)
        mixed = (1.0 - self._learning_rate) * self._covariance + self._learning_rate * seen
        values, vectors = np.linalg.eigh(mixed)
        values = np.maximum(values, self._least)
        covariance = (vectors * values) @ vectors.T
        self._change = float(np.linalg.norm(covariance - self._covariance))
        self._mean = weights @ samples
        self._covariance = covariance
        self._root = (vectors * np.sqrt(values)) @ vectors.T
        self._update += 1


def path_integral_weights(costs: Array, eliteness: float) -> Array:
    """Returns (S,) the weights P of costs (S,) or (S, T), averaged over the steps."""
    to_go = costs_to_go(costs)
    steps = to_go.shape[1]
    remaining = np.arange(steps, 0.0, -1.0)
    weights: Array = exponential_weights(to_go, eliteness) @ (remaining / remaining.sum())
    return weights


def weighted_covariance(samples: Array, weights: Array, mean: Array) -> Array:
    """Returns sum_k w_k (theta_k - theta) (theta_k - theta)', (n, n)."""
    away = samples - mean
    return np.asarray((away.T * weights) @ away)
