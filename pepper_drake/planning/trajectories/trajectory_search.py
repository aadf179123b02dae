"""Optimises a joint path until it is clear: an evolution strategy on B-spline perturbations."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from pepper_drake.planning.trajectories.joint_trajectories import perturbation_basis
from pepper_drake.planning.trajectories.trajectory_cost import TrajectoryRating

Vector = npt.NDArray[np.float64]


@dataclass
class PathSearchParams:
    """Parameters of the search."""

    perturbation_basis: int = 8
    """Number of perturbations per joint."""
    population: int = 48
    generations: int = 20
    polish: int = 4
    """Number of further generations once the path is clear."""
    deviation: float = 0.2
    """Initial standard deviation, in units of `height`."""
    height: float = 0.4
    """Height of a perturbation of weight 1 [rad]."""
    min_slack: float = -0.003
    """Clearance slack above which a path counts as clear [m]."""


class SearchResult(NamedTuple):
    """The best path found.

    Attributes:
        path: (N, 5) rad.
        cost: Its cost.
        slack: Its least clearance minus the desired one [m].
        generations: The generation that found it.
    """

    path: Vector
    cost: float
    slack: float
    generations: int


def optimize_trajectory(
    reference: Vector,
    rate: Callable[[Vector], TrajectoryRating],
    *,
    lower: Vector,
    upper: Vector,
    params: PathSearchParams,
    seed: int = 0,
) -> SearchResult:
    """Searches for a clear path near a reference, with the same start and goal.

    The paths are q = q_ref + height N w with `perturbation_basis` N and five weights w per
    perturbation. A (mu/mu_w, lambda) evolution strategy with cumulative step-size adaptation
    (Hansen and Ostermeier 2001) minimises the cost over w, from w = 0: a reference that is clear is
    returned unchanged.

    Args:
        reference: (N, 5) rad.
        rate: Rates paths (K, N, 5).
        lower: (5,) joint limits, kept by clipping [rad].
        upper: (5,) rad.
        params: Parameters of the search.
        seed: Seed of the random numbers.
    """
    rng = np.random.default_rng(seed)
    shapes = params.height * perturbation_basis(params.perturbation_basis, len(reference)).T
    size = params.perturbation_basis * 5

    def paths_of(weights: Vector) -> Vector:
        # Rows of joints: clipped twice as fast, and what the cost computes with.
        rows = weights.reshape(-1, params.perturbation_basis, 5).swapaxes(1, 2) @ shapes
        rows += reference.T
        return rows.clip(lower[:, None], upper[:, None]).swapaxes(1, 2)

    half = params.population // 2
    shares = np.log(half + 0.5) - np.log(np.arange(1, half + 1))
    shares /= shares.sum()
    effective = 1.0 / np.sum(shares**2)
    c_sigma = (effective + 2.0) / (size + effective + 5.0)
    damping = 1.0 + 2.0 * max(0.0, np.sqrt((effective - 1.0) / (size + 1.0)) - 1.0) + c_sigma
    expected = np.sqrt(size) * (1.0 - 1.0 / (4.0 * size) + 1.0 / (21.0 * size**2))

    mean, p_sigma, sigma = np.zeros(size), np.zeros(size), params.deviation
    best: SearchResult | None = None
    clear_for = 0
    for generation in range(params.generations + 1):
        if generation == 0:
            steps = np.zeros((1, size))
        else:
            steps = rng.standard_normal((params.population, size))
            steps[0] = 0.0  # The mean itself, without noise.
        paths = paths_of(mean + sigma * steps)
        rating = rate(paths)
        order = np.argsort(rating.cost, kind="stable")
        first = order[0]
        if best is None or rating.cost[first] < best.cost:
            best = SearchResult(
                np.ascontiguousarray(paths[first]),
                float(rating.cost[first]),
                float(rating.slack[first]),
                generation,
            )
        if best.slack > params.min_slack:
            if best.generations == 0:
                break
            clear_for += 1
            if clear_for > params.polish:
                break
        if generation:
            step = shares @ steps[order[:half]]
            mean = mean + sigma * step
            gain = np.sqrt(c_sigma * (2.0 - c_sigma) * effective)
            p_sigma = (1.0 - c_sigma) * p_sigma + gain * step
            sigma *= float(np.exp((c_sigma / damping) * (np.linalg.norm(p_sigma) / expected - 1.0)))
    assert best is not None
    return best
