"""Gaussian mixtures over time of several motions, with a component shared at each moment.

An ordinary mixture draws a component for every sample. Where demonstrations differ, components then
distinguish demonstrations rather than moments, and the mean motion jumps between them. Here all M
demonstrations share the component at each moment s:

    p(y_1(s), ..., y_M(s), s) = sum_k pi_k prod_i N_k(s) prod_j N_k(y_i^(j)(s) | s)

with y^(j) the value in frame j (only one, unless task-parametrised). Expectation maximisation stays
exact: the log densities add up over demonstrations.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.probabilistic.gaussian_mixture import (
    GaussianMixture,
    maximisation,
    soft_maximum,
)

Array = npt.NDArray[np.float64]


def fit_shared_mixtures(
    views: Sequence[Array],
    num_demonstrations: int,
    num_components: int,
    *,
    covariance_floor: float = 1e-4,
    max_iterations: int = 100,
    tolerance: float = 1e-5,
) -> tuple[GaussianMixture, ...]:
    """Fits one mixture per view, with shared priors, initialised evenly in time.

    Args:
        views: Per frame, samples of time and value (M N, 1 + D), demonstration by demonstration,
            all at the same N increasing times. Scaled to a deviation of about one.
        num_demonstrations: M.
        num_components: K.
        covariance_floor: Smallest variance in any direction.
        max_iterations: Largest number of EM steps.
        tolerance: Ends when the log-likelihood of a moment gains less than this in a step.

    Raises:
        InputError: There are fewer moments than components.
    """
    num_moments = len(views[0]) // num_demonstrations
    if not 1 <= num_components <= num_moments:
        raise InputError(
            f"num_components is {num_components}; choose 1 to {num_moments}, the number of samples."
        )
    part = np.arange(num_moments) * num_components // num_moments
    members = np.tile(np.eye(num_components)[part], (num_demonstrations, 1))
    size = views[0].shape[1]
    empty = GaussianMixture(
        np.zeros(num_components),
        np.zeros((num_components, size)),
        np.zeros((num_components, size, size)),
    )
    mixtures = tuple(maximisation(view, members, covariance_floor, empty) for view in views)
    best = -np.inf
    for _ in range(max_iterations):
        log_joint = joint_density(mixtures, views, num_demonstrations)
        log_likelihood = soft_maximum(log_joint)[0].mean()
        if log_likelihood - best < tolerance:
            break
        best = log_likelihood
        mixtures = em_step(mixtures, views, log_joint, covariance_floor)
    return mixtures


def joint_density(
    mixtures: Sequence[GaussianMixture], views: Sequence[Array], num_demonstrations: int
) -> Array:
    """Returns log(pi_k prod_i N_k(s) prod_j N_k(y_i^(j) | s)) at each moment, shape (N, K).

    The time is the same in all frames and counts once for each demonstration.
    """
    total = np.zeros((len(views[0]), mixtures[0].num_components))
    for index, (mixture, view) in enumerate(zip(mixtures, views, strict=True)):
        even = replace(mixture, priors=np.ones(mixture.num_components))
        total += even.log_joint(view)
        if index > 0:
            total -= even.marginal(1).log_joint(view[:, :1])
    with np.errstate(divide="ignore"):  # A component that lost all its data has log(0).
        log_priors = np.log(mixtures[0].priors)
    shape = (num_demonstrations, -1, mixtures[0].num_components)
    return np.asarray(log_priors + total.reshape(shape).sum(axis=0))


def em_step(
    mixtures: Sequence[GaussianMixture],
    views: Sequence[Array],
    log_joint: Array,
    covariance_floor: float,
) -> tuple[GaussianMixture, ...]:
    """One step of expectation maximisation from the `joint_density` of the mixtures."""
    _, shared = soft_maximum(log_joint)
    responsibilities = np.tile(shared, (len(views[0]) // len(shared), 1))
    return tuple(
        maximisation(view, responsibilities, covariance_floor, mixture)
        for view, mixture in zip(views, mixtures, strict=True)
    )
