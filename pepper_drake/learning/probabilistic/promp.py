"""Probabilistic movement primitives: a distribution over motions, conditioned on via points.

Paraschos, Daniel, Peters, Neumann, "Probabilistic Movement Primitives", NIPS 2013; the fit by
expectation maximisation follows Lazaric and Ghavamzadeh (2010), as written out by Gomez-Gonzalez et
al.,
"Adaptation and Robust Learning of Probabilistic Movement Primitives" (2020).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ProMP:
    """y(s) = Phi(s) w + noise, w ~ N(mean, covariance), s the time divided by the duration.

    The weights of the three axes are stacked: w = (w_x, w_y, w_z), and may be correlated across
    axes.

    Attributes:
        mean: Of the weights, shape (3 K,) [m].
        covariance: Of the weights, shape (3 K, 3 K) [m²].
        noise: Variance of the residuals [m²].
        duration: Median duration of the demonstrations [s].
    """

    mean: Array
    covariance: Array
    noise: float
    duration: float

    __repr__ = short_repr

    @property
    def num_basis(self) -> int:
        """K, the basis functions of one axis."""
        return len(self.mean) // 3

    def path(self, times: npt.ArrayLike) -> tuple[Array, Array]:
        """Returns the mean positions (N, 3) [m] and their covariances (N, 3, 3) at times (N,) [s].

        The covariance is that between motions, without `noise`.
        """
        functions = basis(np.asarray(times, dtype=float) / self.duration, self.num_basis)
        means = functions @ self.mean.reshape(3, -1).T
        blocks = self.covariance.reshape(3, self.num_basis, 3, self.num_basis)
        covariances = np.einsum("nk,akbl,nl->nab", functions, blocks, functions, optimize=True)
        return means, np.asarray(covariances)

    def condition(
        self,
        time: float,
        value: npt.ArrayLike,
        *,
        covariance: npt.ArrayLike | None = None,
        derivative: Literal[0, 1] = 0,
    ) -> Self:
        """Returns the distribution of the motions that pass a via point (eqs. 5 and 6).

        Args:
            time: Time [s] from 0, the start, to `duration`, the end.
            value: Position (3,) [m], or velocity (3,) [m/s] with `derivative` 1.
            covariance: Tolerance, shape (3, 3), in `value`'s units squared; 0.1 mm (or mm/s)
                when left out.
            derivative: 0 for a position, 1 for a velocity.
        """
        wanted = np.asarray(value, dtype=float)
        slack = 1e-8 * np.eye(3) if covariance is None else np.asarray(covariance, dtype=float)
        if wanted.shape != (3,) or slack.shape != (3, 3):
            raise InputError(
                f"a via point needs value (3,) and covariance (3, 3), not {wanted.shape} and "
                f"{slack.shape}."
            )
        functions = basis(np.array([time / self.duration]), self.num_basis, derivative)
        rows = _rows(functions / self.duration**derivative)
        innovation = rows @ self.covariance @ rows.T + slack
        gain = np.linalg.solve(innovation, rows @ self.covariance).T
        # Joseph form: stays symmetric and positive for any covariance of the via point.
        kept = np.eye(len(self.mean)) - gain @ rows
        return replace(
            self,
            mean=self.mean + gain @ (wanted - rows @ self.mean),
            covariance=kept @ self.covariance @ kept.T + gain @ slack @ gain.T,
        )

    def sample(self, count: int, rng: np.random.Generator) -> Array:
        """Draws weights, shape (count, 3 K); `demonstration` makes a motion of each."""
        values, vectors = np.linalg.eigh(self.covariance)
        factor = vectors * np.sqrt(np.maximum(values, 0.0))
        return np.asarray(self.mean + rng.standard_normal((count, len(values))) @ factor.T)

    def demonstration(
        self,
        weights: Array | None = None,
        *,
        duration: float | None = None,
        time_step: float = 0.01,
    ) -> Demonstration:
        """Returns the motion of weights (3 K,), of the mean when left out, as a demonstration.

        A `MovementPrimitive` can learn from it, for other goals and obstacles.
        """
        length = duration or self.duration
        times = np.linspace(0, length, max(6, round(length / time_step) + 1))
        columns = (self.mean if weights is None else weights).reshape(3, -1).T
        positions, velocities, accelerations = (
            basis(times / length, self.num_basis, order) @ columns / length**order
            for order in (0, 1, 2)
        )
        return Demonstration(
            times, positions, velocities, accelerations, name="promp", derivation="exact"
        )

    def log_likelihood(self, demonstrations: Sequence[Demonstration]) -> float:
        """Returns log p of all the demonstrations' positions."""
        total = 0.0
        for rows, targets in observations(demonstrations, self.num_basis):
            deviation = targets - rows @ self.mean
            posterior = np.linalg.inv(self.covariance) + rows.T @ rows / self.noise
            solved = np.linalg.solve(posterior, rows.T @ deviation) / self.noise
            quadratic = (deviation @ deviation - (rows.T @ deviation) @ solved) / self.noise
            log_determinant = (
                np.linalg.slogdet(posterior)[1]
                + np.linalg.slogdet(self.covariance)[1]
                + len(targets) * np.log(self.noise)
            )
            total -= 0.5 * (quadratic + log_determinant + len(targets) * np.log(2 * np.pi))
        return float(total)


def basis(phases: npt.ArrayLike, num_basis: int, derivative: int = 0) -> Array:
    """Returns normalised Gaussians of s, or their first or second derivative, shape (N, K).

    Centres are evenly spaced in [0, 1] and one spacing beyond at each end, so that a motion may
    start and end while moving; the standard deviation is one spacing.
    """
    spacing = 1 / max(num_basis - 3, 1)
    centres = np.linspace(-spacing, 1 + spacing, num_basis)
    offsets = (np.asarray(phases, dtype=float)[:, None] - centres) / spacing
    values = np.exp(-0.5 * (offsets**2 - np.min(offsets**2, axis=1, keepdims=True)))
    values /= values.sum(axis=1, keepdims=True)
    if derivative == 0:
        return np.asarray(values)
    # With l = log psi, psi / sum psi has the derivative h (l' - E l'), E the mean under h.
    slopes = -offsets / spacing
    mean_slope = np.sum(values * slopes, axis=1, keepdims=True)
    first = values * (slopes - mean_slope)
    if derivative == 1:
        return np.asarray(first)
    # l'' is the same for all, so it cancels in l'' - d/ds E l' = - sum h' l'.
    drift = np.sum(first * slopes, axis=1, keepdims=True)
    return np.asarray(first * (slopes - mean_slope) - values * drift)


def fit_promp(
    demonstrations: Sequence[Demonstration],
    *,
    num_basis: int = 20,
    ridge: float = 1e-6,
    max_iterations: int = 30,
    tolerance: float = 1e-6,
) -> ProMP:
    """Fits the distribution of the weights by expectation maximisation.

    EM starts from the mean and covariance of the weights of one ridge regression per demonstration;
    `max_iterations=0` returns these. Demonstrations may differ in duration and sampling.

    Args:
        demonstrations: At least two.
        num_basis: K, basis functions of one axis, at least 4.
        ridge: Relative to the mean diagonal of Phi^T Phi; and, times the variance of the weights,
            added to their covariance, which is singular with few demonstrations.
        max_iterations: Largest number of EM steps.
        tolerance: Ends when an EM step changes no weight's mean or variance by more than this share
            of the weights' variance.

    Raises:
        InputError: Too few demonstrations or basis functions.
    """
    if len(demonstrations) < 2:
        raise InputError("a ProMP is a distribution; give at least two demonstrations.")
    if num_basis < 4:
        raise InputError(f"num_basis is {num_basis}; a ProMP needs at least 4.")
    data = observations(demonstrations, num_basis)
    weights = np.array([_ridge_regression(rows, targets, ridge) for rows, targets in data])
    residuals = [targets - rows @ w for (rows, targets), w in zip(data, weights, strict=True)]
    mean = weights.mean(axis=0)
    scale = float(np.mean((weights - mean) ** 2)) or 1e-12
    floor = ridge * scale * np.eye(len(mean))
    covariance = (weights - mean).T @ (weights - mean) / len(weights) + floor
    noise = max(float(np.mean(np.concatenate(residuals) ** 2)), 1e-12)
    promp = ProMP(mean, covariance, noise, float(np.median([d.duration for d in demonstrations])))
    for _ in range(max_iterations):
        updated = em_step(promp, data, floor)
        change = max(
            np.max((updated.mean - promp.mean) ** 2),
            np.max(np.abs(np.diagonal(updated.covariance - promp.covariance))),
        )
        promp = updated
        if change < tolerance * scale:
            break
    return promp


def em_step(promp: ProMP, data: Sequence[tuple[Array, Array]], floor: Array) -> ProMP:
    """One step of expectation maximisation.

    Args:
        promp: The current distribution.
        data: From `observations`: per demonstration, rows (3 N, 3 K) and positions (3 N,).
        floor: Added to the covariance, shape (3 K, 3 K): the mode under an inverse Wishart prior.
    """
    precision = np.linalg.inv(promp.covariance)
    means, covariances = [], []
    squared, count = 0.0, 0
    for rows, targets in data:
        covariance = np.linalg.inv(precision + rows.T @ rows / promp.noise)
        mean = covariance @ (precision @ promp.mean + rows.T @ targets / promp.noise)
        residual = targets - rows @ mean
        squared += float(residual @ residual + np.sum((rows @ covariance) * rows))
        count += len(targets)
        means.append(mean)
        covariances.append(covariance)
    mean = np.mean(means, axis=0)
    deviations = np.array(means) - mean
    spread = np.mean(covariances, axis=0) + deviations.T @ deviations / len(means) + floor
    return replace(promp, mean=mean, covariance=spread, noise=max(squared / count, 1e-12))


def observations(
    demonstrations: Sequence[Demonstration], num_basis: int
) -> list[tuple[Array, Array]]:
    """Returns rows (3 N, 3 K) and stacked positions (3 N,) of each demonstration."""
    return [
        (
            _rows(basis((demo.times - demo.times[0]) / demo.duration, num_basis)),
            demo.positions.T.ravel(),
        )
        for demo in demonstrations
    ]


def _rows(functions: Array) -> Array:
    """Returns Phi (3 N, 3 K) of basis functions (N, K) shared by all axes."""
    return np.asarray(np.kron(np.eye(3), functions))


def _ridge_regression(rows: Array, targets: Array, ridge: float) -> Array:
    normal = rows.T @ rows
    normal += ridge * np.trace(normal) / len(normal) * np.eye(len(normal))
    return np.asarray(np.linalg.solve(normal, rows.T @ targets))
