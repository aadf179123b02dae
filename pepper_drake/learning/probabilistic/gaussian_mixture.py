"""Gaussian mixture model, its fit by expectation maximisation, and Gaussian mixture regression.

Equations 2.1-2.3 and A.1-A.5 of "Learning By Demonstration" (SoftBank Robotics, 2018), after
Dempster, Laird, Rubin (1977) and Calinon, Guenter, Billard, "On Learning, Representing and
Generalizing a Task in a Humanoid Robot" (2007).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.cluster.vq import kmeans2

from pepper_drake.errors import InputError
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Regression:
    """Outputs of a mixture given its inputs.

    Attributes:
        means: Expected outputs, shape (N, num_outputs).
        covariances: Their covariances, shape (N, num_outputs, num_outputs).
    """

    means: Array
    covariances: Array


@dataclass(frozen=True)
class GaussianMixture:
    """p(v) = sum_k pi_k N(v; mu_k, Sigma_k), equation 2.2.

    Attributes:
        priors: pi, shape (K,), summing to one.
        means: mu, shape (K, D).
        covariances: Sigma, shape (K, D, D), positive definite.
    """

    priors: Array
    means: Array
    covariances: Array

    __repr__ = short_repr

    @property
    def num_components(self) -> int:
        """K."""
        return len(self.priors)

    def log_joint(self, data: Array) -> Array:
        """Returns log(pi_k N(v_i; mu_k, Sigma_k)), shape (N, K), for data of shape (N, D)."""
        factors = np.linalg.cholesky(self.covariances)
        whiten = np.linalg.inv(factors)
        offsets = (whiten @ self.means[:, :, None])[:, :, 0]
        squares = np.zeros((len(data), self.num_components))
        for row, offset in zip(np.swapaxes(whiten, 0, 1), offsets.T, strict=True):
            squares += (data @ row.T - offset) ** 2
        log_determinants = 2 * np.log(np.diagonal(factors, axis1=1, axis2=2)).sum(axis=1)
        with np.errstate(divide="ignore"):  # A component that lost all its data has log(0).
            log_priors = np.log(self.priors)
        constant = log_priors - 0.5 * (log_determinants + data.shape[1] * np.log(2 * np.pi))
        return np.asarray(constant - 0.5 * squares)

    def log_likelihood(self, data: Array) -> float:
        """Returns the mean of log p(v_i) over data of shape (N, D)."""
        return float(soft_maximum(self.log_joint(data))[0].mean())

    def responsibilities(self, data: Array) -> Array:
        """Returns h_ki = p(k | v_i), equation A.4, shape (N, K), for data of shape (N, D)."""
        return soft_maximum(self.log_joint(data))[1]

    def marginal(self, num_dims: int) -> GaussianMixture:
        """Returns the mixture of the first `num_dims` coordinates."""
        return GaussianMixture(
            self.priors, self.means[:, :num_dims], self.covariances[:, :num_dims, :num_dims]
        )

    def transformed(self, matrices: Array, offsets: Array) -> GaussianMixture:
        """Returns the mixture of A v + b for A of shape (E, D) or (K, E, D), b (E,) or (K, E)."""
        means = (matrices @ self.means[:, :, None])[:, :, 0] + offsets
        covariances = matrices @ self.covariances @ np.swapaxes(matrices, -1, -2)
        return GaussianMixture(self.priors, means, covariances)

    def experts(self, num_inputs: int = 1) -> tuple[Array, Array, Array]:
        """Returns each component's linear regression of the other coordinates on the first ones.

        For component k: outputs = gains_k @ inputs + offsets_k, with the residual covariance
        Sigma_o - Sigma_oi Sigma_i^-1 Sigma_io.

        Returns:
            gains (K, O, I), offsets (K, O) and residual covariances (K, O, O).
        """
        inputs, outputs = slice(None, num_inputs), slice(num_inputs, None)
        cross = self.covariances[:, inputs, outputs]
        solved = np.linalg.solve(self.covariances[:, inputs, inputs], cross)
        gains = np.swapaxes(solved, 1, 2)
        offsets = self.means[:, outputs] - (gains @ self.means[:, inputs, None])[:, :, 0]
        residuals = self.covariances[:, outputs, outputs] - gains @ cross
        return gains, offsets, residuals

    def regress(
        self, inputs: Array, covariance: Literal["posterior", "report"] = "posterior"
    ) -> Regression:
        """Gaussian mixture regression, equation 2.3: outputs given the first coordinates.

        Args:
            inputs: Shape (N, I): the first I coordinates of the mixture.
            covariance: `posterior` is the covariance of the conditional mixture (law of total
                covariance), sum_k h_k (C_k + m_k m_k^T) - m m^T; `report` is that of equation
                2.3, sum_k h_k^2 C_k, without the spread between the components.
        """
        num_inputs = inputs.shape[1]
        gains, offsets, residuals = self.experts(num_inputs)
        activations = self.marginal(num_inputs).responsibilities(inputs)
        predictions = np.einsum("koi,ni->nko", gains, inputs) + offsets
        means = np.einsum("nk,nko->no", activations, predictions)
        if covariance == "report":
            return Regression(means, np.einsum("nk,kop->nop", activations**2, residuals))
        deviations = predictions - means[:, None, :]
        spread = np.einsum("nk,nko,nkp->nop", activations, deviations, deviations, optimize=True)
        return Regression(means, np.einsum("nk,kop->nop", activations, residuals) + spread)

    def sample(self, count: int, rng: np.random.Generator) -> Array:
        """Draws vectors, shape (count, D)."""
        components = rng.choice(self.num_components, size=count, p=self.priors)
        noise = rng.standard_normal((count, self.means.shape[1], 1))
        factors = np.linalg.cholesky(self.covariances)[components]
        return np.asarray(self.means[components] + (factors @ noise)[:, :, 0])


def maximisation(
    data: Array, responsibilities: Array, covariance_floor: float, previous: GaussianMixture
) -> GaussianMixture:
    """The M step, equation A.5, under the constraint that no variance is below a floor.

    The eigenvalues of each covariance are raised to the floor. This is the exact maximiser among
    the covariances with Sigma_k >= floor * I, so the likelihood never falls, as it may if a
    constant is added to the diagonal.

    Args:
        data: Shape (N, D).
        responsibilities: h, shape (N, K).
        covariance_floor: Smallest eigenvalue of a covariance, in the data's units squared.
        previous: Kept by components that hold no data.
    """
    counts = responsibilities.sum(axis=0)
    held = counts > np.finfo(float).tiny * len(data)
    weights = responsibilities[:, held].T / counts[held, None]
    # Moments about the mean of all data, against cancellation.
    centre = data.mean(axis=0)
    centred = data - centre
    first = weights @ centred
    products = (centred[:, :, None] * centred[:, None, :]).reshape(len(data), -1)
    second = (weights @ products).reshape(-1, data.shape[1], data.shape[1])
    means, covariances = previous.means.copy(), previous.covariances.copy()
    means[held] = first + centre
    scatter = second - first[:, :, None] * first[:, None, :]
    eigenvalues, eigenvectors = np.linalg.eigh(scatter)
    raised = np.maximum(eigenvalues, covariance_floor)
    covariances[held] = (eigenvectors * raised[:, None, :]) @ np.swapaxes(eigenvectors, 1, 2)
    return GaussianMixture(counts / len(data), means, covariances)


def initial_mixture(
    data: Array,
    num_components: int,
    covariance_floor: float,
    *,
    initial_means: Array | None = None,
    rng: np.random.Generator,
) -> GaussianMixture:
    """Initialises a mixture by k-means (the report's appendix A).

    Args:
        data: Shape (N, D).
        num_components: K.
        covariance_floor: As in `maximisation`.
        initial_means: Initial centroids, shape (K, D); drawn by k-means++ when left out.
        rng: For k-means++.
    """
    with warnings.catch_warnings():
        # A cluster left without data keeps its centroid, and EM may fill it.
        warnings.filterwarnings("ignore", message="One of the clusters is empty")
        if initial_means is None:
            centroids, labels = kmeans2(data, num_components, minit="++", rng=rng)
        else:
            centroids, labels = kmeans2(data, initial_means, minit="matrix")
    spread = np.cov(data, rowvar=False, bias=True) + covariance_floor * np.eye(data.shape[1])
    empty = GaussianMixture(
        np.full(num_components, 1 / num_components),
        centroids,
        np.tile(spread, (num_components, 1, 1)),
    )
    return maximisation(data, np.eye(num_components)[labels], covariance_floor, empty)


def fit_gaussian_mixture(
    data: Array,
    num_components: int,
    *,
    covariance_floor: float = 1e-5,
    max_iterations: int = 100,
    tolerance: float = 1e-5,
    initial_means: Array | None = None,
    seed: int = 0,
) -> GaussianMixture:
    """Fits a mixture by expectation maximisation, equations A.2-A.5.

    Args:
        data: Shape (N, D), N >= num_components.
        num_components: K.
        covariance_floor: Smallest variance in any direction, as a fraction of each coordinate's
            variance over all data.
        max_iterations: Largest number of EM steps.
        tolerance: Ends when the mean log-likelihood gains less than this in a step.
        initial_means: Initial centroids, shape (K, D); drawn by k-means++ when left out.
        seed: Of k-means++.

    Raises:
        InputError: There are fewer samples than components.
    """
    if not 1 <= num_components <= len(data):
        raise InputError(
            f"num_components is {num_components}; choose 1 to {len(data)}, the number of samples."
        )
    # Each coordinate is scaled to unit variance, so that seconds and metres weigh the same.
    centre, scale = data.mean(axis=0), data.std(axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    scaled = (data - centre) / scale
    start = None if initial_means is None else (initial_means - centre) / scale
    mixture = initial_mixture(
        scaled,
        num_components,
        covariance_floor,
        initial_means=start,
        rng=np.random.default_rng(seed),
    )
    best = -np.inf
    for _ in range(max_iterations):
        log_densities, responsibilities = soft_maximum(mixture.log_joint(scaled))
        log_likelihood = log_densities.mean()
        if log_likelihood - best < tolerance:
            break
        best = log_likelihood
        mixture = maximisation(scaled, responsibilities, covariance_floor, mixture)
    return mixture.transformed(np.diag(scale), centre)


def soft_maximum(log_joint: Array) -> tuple[Array, Array]:
    """Returns log(sum_k exp(l_ik)), shape (N,), and exp(l_ik) divided by that sum, (N, K)."""
    highest = log_joint.max(axis=1, keepdims=True)
    weights = np.exp(log_joint - highest)
    sums = weights.sum(axis=1, keepdims=True)
    return (highest + np.log(sums))[:, 0], weights / sums
