"""Policy learning by weighting exploration with the returns: PoWER, equations D.4 to D.6.

Kober and Peters, "Policy search for motor primitives in robotics", Machine Learning 84, 2011.
"""

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.optimization.gaussian_search import GaussianSearch
from pepper_drake.optimization.optimizer import check_positive
from pepper_drake.optimization.problem import Problem, costs_to_go, total_costs
from pepper_drake.optimization.weighting import ELITENESS, best, normalized

Array = npt.NDArray[np.float64]


class Power(GaussianSearch):
    """PoWER with state-dependent exploration, held over each rollout.

    The policy is a = (theta + eps)' psi (D.4, D.5 with eps(psi) = eps' psi): for a primitive, psi
    is the acceleration per parameter, a function of the phase. An update is the weighted regression
    D.6 of the actions of the best rollouts h so far (the paper's importance
    sampler) on psi, for each coordinate,

        theta <- theta + (sum_ht W_t Q_ht)^-1 sum_ht W_t Q_ht (theta_h - theta),
        W_t = psi_t psi_t' / (psi_t' Sigma psi_t),

    with Q_ht > 0 from the cost-to-go of rollout h at step t: its exponential, scaled from 1 (the
    cheapest of those kept) to exp(-h). For costs without steps, or a problem without features, Q_h
    is one number and theta the weighted average of the rollouts.

    The exploration is learned as well: the variance of each parameter becomes the return-weighted
    mean of (theta_h - theta)², within a band below the initial variance.
    """

    def __init__(
        self,
        problem: Problem,
        *,
        samples: int = 10,
        seed: int = 0,
        rate: float | None = None,
        kept: int = 10,
        eliteness: float = ELITENESS,
        band: float = 100.0,
        threshold: float = 1e-8,
    ) -> None:
        """Starts at the problem's guess.

        Args:
            problem: What is minimised.
            samples: Rollouts of each update.
            seed: Of the exploration.
            rate: Initial variance of the exploration; the problem's if left out.
            kept: Number of best rollouts that count.
            eliteness: h, the exponent of the best one's weight relative to the worst of those.
            band: Largest factor by which the exploration's deviation may shrink.
            threshold: It has converged when no variance changes by this share of the first.

        Raises:
            InputError: A setting is out of range.
        """
        super().__init__(problem, samples=samples, seed=seed, rate=rate, least=1)
        check_positive(eliteness=eliteness)
        if kept < 1:
            raise InputError(f"kept: {kept} rollouts; use at least 1")
        if not band >= 1.0:
            raise InputError(f"band: {band} is not 1 or more")
        self._features = problem.features
        self._variances = np.full(len(self._mean), self._rate)
        self._kept, self._eliteness, self._band = kept, eliteness, band
        self._threshold = threshold
        self._change = np.inf
        self._best: tuple[Array, Array] | None = None

    @property
    def deviations(self) -> Array:
        """(n,) standard deviations of the exploration."""
        return np.sqrt(self._variances)

    @property
    def converged(self) -> bool:
        """True if the last update changed no variance."""
        return self._change < self._threshold

    def tell(self, costs: Array) -> None:
        """Updates theta and the exploration."""
        samples, costs = self.ask(), np.asarray(costs, dtype=float)
        if self._best is not None:
            samples = np.concatenate((self._best[0], samples))
            costs = np.concatenate((self._best[1], costs))
        chosen = best(total_costs(costs), self._kept)
        samples, costs = samples[chosen], costs[chosen]
        self._best = samples, costs
        returns = np.exp(self._eliteness * normalized(costs_to_go(costs)))
        explored = samples - self._mean
        spread = returns.mean(axis=1) @ explored**2 / returns.mean(axis=1).sum()
        variances = np.clip(spread, self._rate / self._band**2, self._rate)
        step = policy_step(explored, returns, self._policy_features(returns), self._variances)
        self._change = float(np.abs(variances - self._variances).max()) / self._rate
        self._mean, self._variances = self._mean + step, variances
        self._update += 1

    def _policy_features(self, returns: Array) -> Array | None:
        steps = returns.shape[1]
        return None if self._features is None or steps == 1 else self._features(steps)


def policy_step(explored: Array, returns: Array, features: Array | None, variances: Array) -> Array:
    """Returns equation D.6: the change (n,) of theta.

    Args:
        explored: (H, n) exploration noise: each rollout's parameters minus theta.
        returns: (H, T) positive Q.
        features: (T, R) psi, where n = R times the number of coordinates and the coordinates of a
            feature are adjacent; None for policies without steps.
        variances: (n,) of the exploration.
    """
    if features is None:
        weights = returns.mean(axis=1)
        return np.asarray(weights @ explored / weights.sum())
    rows = features.shape[1]
    changes = explored.reshape(len(explored), rows, -1)
    sigma = variances.reshape(rows, -1)
    step = np.empty(changes.shape[1:])
    for k in range(changes.shape[2]):
        scale = (features**2 @ sigma[:, k])[:, None]
        weighted = features / np.where(scale > 0.0, scale, 1.0)
        left = weighted.T @ (features * returns.sum(axis=0)[:, None])
        right = sum(
            weighted.T @ (features @ change * q)
            for change, q in zip(changes[:, :, k], returns, strict=True)
        )
        step[:, k] = np.linalg.lstsq(left, right, rcond=1e-10)[0]
    return step.ravel()
