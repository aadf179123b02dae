"""Least squares on the trajectory itself: the approximators `trajectory`, `trajectory_slopes`.

The motion is linear in the forcing term's weights: position = the unforced spring's trajectory +
the response to each basis function times its weight. Fitting the weights to the positions rather
than the forcing term makes the *motion* the closest one. It needs no accelerations, and errors of
the forcing term that cancel out in the motion cost nothing.

The responses depend on the samples' relative times only, so the solver is cached for each number of
samples and basis functions.
"""

from functools import lru_cache

import numpy as np

from pepper_drake.learning.approximators.gaussian_forcing import GaussianForcing, even_basis
from pepper_drake.learning.approximators.registry import Approximator, Array, ForcingData, register
from pepper_drake.learning.cached_times import TimesKey
from pepper_drake.learning.least_squares import ridge_regression, ridge_solver
from pepper_drake.learning.phase import phase_at
from pepper_drake.learning.spring import forced_response_at, node_times

OVERLAP = 0.85
SLOPES_OVERLAP = 0.7


def fit_trajectory(data: ForcingData, num_basis: int, seed: int) -> GaussianForcing:
    """Least squares on the positions, one weight per basis function."""
    del seed
    return _fit(data, num_basis, OVERLAP, slopes=False)


def fit_trajectory_slopes(data: ForcingData, num_basis: int, seed: int) -> GaussianForcing:
    """Least squares on the positions, a constant and a slope per basis function."""
    del seed
    return _fit(data, num_basis, SLOPES_OVERLAP, slopes=True)


def _fit(data: ForcingData, num_basis: int, overlap: float, slopes: bool) -> GaussianForcing:
    basis = even_basis(num_basis, overlap, data.alpha_x, slopes=slopes)
    key = (num_basis, overlap, slopes, data.alpha_x, data.alpha_z)
    if len(data.lengths) == 1 and np.ptp(data.scales, axis=0).max() == 0.0:
        solver = _cached_solver(TimesKey(data.times), *key)
        return GaussianForcing(basis, solver @ data.responses)
    ends = np.cumsum(data.lengths)[:-1]
    columns = np.vstack([_responses(times, *key) for times in np.split(data.times, ends)])
    return GaussianForcing(basis, ridge_regression(columns, data.responses, data.scales))


@lru_cache(maxsize=32)
def _cached_solver(
    times: TimesKey, num_basis: int, overlap: float, slopes: bool, alpha_x: float, alpha_z: float
) -> Array:
    return ridge_solver(_responses(times.times, num_basis, overlap, slopes, alpha_x, alpha_z))


def _responses(
    times: Array, num_basis: int, overlap: float, slopes: bool, alpha_x: float, alpha_z: float
) -> Array:
    """Returns (N, K): the response of the position to each feature at the times, for tau = 1."""
    basis = even_basis(num_basis, overlap, alpha_x, slopes=slopes)
    nodes = node_times(times)
    features = basis.features(phase_at(nodes.ravel(), alpha_x))
    return forced_response_at(features.reshape(*nodes.shape, -1), times, alpha_z)[0]


register(Approximator("trajectory", fit_trajectory, GaussianForcing.from_data))
register(Approximator("trajectory_slopes", fit_trajectory_slopes, GaussianForcing.from_data))
