"""The approximator `gmr`: the forcing term by Gaussian mixture regression on the motion's time.

Equations 2.1-2.3 and appendix A of "Learning By Demonstration" (SoftBank Robotics, 2018).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from scipy.interpolate import make_interp_spline

from pepper_drake.learning.approximators.local_lines import LineBasis, LocalLines, read_basis
from pepper_drake.learning.approximators.registry import (
    Approximator,
    Array,
    ForcingData,
    fade_out,
    register,
)
from pepper_drake.learning.probabilistic.gaussian_mixture import (
    GaussianMixture,
    fit_gaussian_mixture,
)
from pepper_drake.learning.probabilistic.shared_mixture import fit_shared_mixtures


@dataclass(frozen=True, eq=False)
class GmrForcing(LocalLines):
    """Gaussian mixture regression of f on time s (equation 2.3), stored as local lines.

    Heights are the components' means of f, slopes are Sigma_fs / Sigma_s, gains are
    log(pi / sqrt(Sigma_s)). With the residuals it still gives the posterior covariance.

    Attributes:
        residuals: Covariance of f about each line, shape (K, D, D).
    """

    residuals: Array

    def to_data(self) -> dict[str, Any]:
        """Returns the model as plain data."""
        return {**super().to_data(), "residuals": self.residuals.tolist()}

    @classmethod
    def from_data(cls, data: Mapping[str, Any]) -> Self:
        """Makes the model from what `to_data` returned."""
        weights, residuals = (np.array(data[key], float) for key in ("weights", "residuals"))
        return cls(read_basis(data), weights, residuals)

    def covariances(self, phases: npt.ArrayLike) -> Array:
        """Returns the posterior covariance of the forcing term, (N, D, D), at phases (N,).

        It is the conditional mixture's: the spread of f about the lines plus that between the
        lines.
        """
        activations, offsets = self.basis.activations(phases)
        heights, slopes = np.split(self.weights, 2)
        lines = heights + offsets[:, :, None] * slopes
        deviations = lines - np.einsum("nk,nkd->nd", activations, lines)[:, None, :]
        within = np.einsum("nk,kde->nde", activations, self.residuals)
        between = np.einsum("nk,nkd,nke->nde", activations, deviations, deviations, optimize=True)
        gate = fade_out(phases, self.basis.alpha_x)[:, None, None]
        return np.asarray(gate**2 * (within + between))


def from_mixture(mixture: GaussianMixture, alpha_x: float) -> GmrForcing:
    """Converts a mixture over (s, f), 1 + D coordinates, to a forcing term."""
    gains, _, residuals = mixture.experts(num_inputs=1)
    variances = mixture.covariances[:, 0, 0]
    held = mixture.priors > 0  # EM may leave a component without any data.
    basis = LineBasis(
        alpha_x,
        np.log(mixture.priors[held] / np.sqrt(variances[held])),
        mixture.means[held, 0],
        variances[held],
    )
    weights = np.vstack([mixture.means[held, 1:], gains[held, :, 0]])
    return GmrForcing(basis, weights, residuals[held])


def fit_gmr(data: ForcingData, num_basis: int, seed: int) -> GmrForcing:
    """Fits a mixture over time and forcing term, initialised evenly along the motion.

    Several demonstrations are fitted with a `shared_mixture`: its covariance is their variability
    at each moment.

    Args:
        data: Samples of the forcing term.
        num_basis: Number of components.
        seed: Unused: the even initialisation is not random, and does better than k-means++.

    Raises:
        InputError: There are fewer samples than components.
    """
    samples = np.column_stack([data.times, data.targets])
    if len(data.lengths) > 1:
        return from_mixture(_fit_several(samples, data.lengths, num_basis), data.alpha_x)
    evenly = (np.arange(num_basis) + 0.5) / max(num_basis, 1) * len(samples)
    start = samples[evenly.astype(int)]
    mixture = fit_gaussian_mixture(samples, num_basis, initial_means=start, seed=seed)
    return from_mixture(mixture, data.alpha_x)


def _fit_several(samples: Array, lengths: tuple[int, ...], num_basis: int) -> GaussianMixture:
    """Fits a shared mixture after resampling all demonstrations at the same times."""
    clock = np.linspace(0, 1, int(np.median(lengths)))
    motions = np.split(samples, np.cumsum(lengths)[:-1])
    resampled = [make_interp_spline(motion[:, 0], motion[:, 1:])(clock) for motion in motions]
    stacked = np.column_stack([np.tile(clock, len(motions)), np.vstack(resampled)])
    scale = np.where(stacked.std(axis=0) > 0, stacked.std(axis=0), 1.0)
    (mixture,) = fit_shared_mixtures(
        [stacked / scale], len(motions), num_basis, covariance_floor=1e-5
    )
    return mixture.transformed(np.diag(scale), np.zeros(len(scale)))


register(Approximator("gmr", fit_gmr, GmrForcing.from_data))
