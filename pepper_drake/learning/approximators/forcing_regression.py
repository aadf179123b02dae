"""Approximators that regress the forcing term itself: LWR, LWR with slopes, RBFN.

`lwr` is the report's B.1: each basis function's weight minimises its own weighted error. An
overlap of 0.4 is a compromise: the local mean flattens curves in proportion to the width squared,
and with 60 basis functions on 2 s at 100 Hz narrower ones would see fewer than two samples each.
`lwr_slopes` fits a line instead of a mean. `rbfn` (B.2 to B.4) fits all weights at once; wide
functions then interpolate best, and the ridge term regularises them.
"""

import numpy as np

from pepper_drake.learning.approximators.gaussian_forcing import GaussianForcing, even_basis
from pepper_drake.learning.approximators.registry import Approximator, Array, ForcingData, register
from pepper_drake.learning.least_squares import ridge_regression

LWR_OVERLAP = 0.4
RBFN_OVERLAP = 1.0


def fit_lwr(data: ForcingData, num_basis: int, seed: int) -> GaussianForcing:
    """Locally weighted regression, one weight per basis function (B.1).

    w_i = sum_t psi_i xi f / sum_t psi_i xi², with xi = x times the scaling.
    """
    del seed
    basis = even_basis(num_basis, LWR_OVERLAP, data.alpha_x)
    kernels = _kernels(data, num_basis)
    squares = data.scales**2
    x = data.phases[:, None]
    moments = (kernels * x).T @ (data.targets * squares)
    masses = (kernels * x * x).T @ squares
    return GaussianForcing(basis, moments / np.maximum(masses, np.finfo(float).tiny))


def fit_lwr_slopes(data: ForcingData, num_basis: int, seed: int) -> GaussianForcing:
    """Locally weighted regression with local lines: (w_i, w'_i) by 2 x 2 normal equations."""
    del seed
    basis = even_basis(num_basis, LWR_OVERLAP, data.alpha_x, slopes=True)
    kernels = _kernels(data, num_basis)
    x = data.phases[:, None]
    offsets = (x - basis.centres) / basis.widths
    squares = data.scales**2
    weighted = kernels * x * x
    s0, s1, s2 = (
        (weighted * power).T @ squares for power in (np.ones_like(offsets), offsets, offsets**2)
    )
    m0, m1 = ((kernels * x * power).T @ (data.targets * squares) for power in (1.0, offsets))
    tiny = np.finfo(float).tiny
    # With a single sample the slope is undetermined: the ridge makes it zero.
    s2 = s2 + 1e-9 * s0
    determinants = np.maximum(s0 * s2 - s1 * s1, tiny)
    heights = (m0 * s2 - m1 * s1) / determinants
    slopes = (m1 * s0 - m0 * s1) / determinants
    return GaussianForcing(basis, np.concatenate((heights, slopes)))


def fit_rbfn(data: ForcingData, num_basis: int, seed: int) -> GaussianForcing:
    """Radial basis function network: least squares over all weights (B.3, B.4)."""
    del seed
    basis = even_basis(num_basis, RBFN_OVERLAP, data.alpha_x, normalized=False)
    return GaussianForcing(
        basis, ridge_regression(basis.features(data.phases), data.targets, data.scales)
    )


def _kernels(data: ForcingData, num_basis: int) -> Array:
    """Returns (N, B): the basis functions at the samples, not normalised."""
    return even_basis(num_basis, LWR_OVERLAP, data.alpha_x, normalized=False).activations(
        data.phases
    )


register(Approximator("lwr", fit_lwr, GaussianForcing.from_data))
register(Approximator("lwr_slopes", fit_lwr_slopes, GaussianForcing.from_data))
register(Approximator("rbfn", fit_rbfn, GaussianForcing.from_data))
