"""Least squares with scaled columns and a small ridge."""

import numpy as np
import numpy.typing as npt
from scipy.linalg import qr, solve_triangular

Array = npt.NDArray[np.float64]

RIDGE = 1e-12
"""Ridge relative to columns of norm one: it only decides what the data do not determine."""


def ridge_solver(columns: Array) -> Array:
    """Returns the matrix (K, N) that maps targets (N, D) to the ridge solution (K, D).

    Minimises |columns w - targets|² + RIDGE |S w|², S the diagonal of the columns' norms, by QR:
    the normal equations would square a condition number of up to 1e6.
    """
    norms = np.linalg.norm(columns, axis=0)
    norms = np.where(norms > 0.0, norms, 1.0)
    size = columns.shape[1]
    stacked = np.vstack((columns / norms, np.sqrt(RIDGE) * np.eye(size)))
    q, r = qr(stacked, mode="economic", overwrite_a=True, check_finite=False)
    solution = solve_triangular(r, q[: len(columns)].T, check_finite=False)
    return solution / norms[:, None]


def ridge_regression(columns: Array, targets: Array, scales: Array) -> Array:
    """Returns weights (K, D) minimising the residuals (N, D) times `scales` (N, D)."""
    if np.ptp(scales) == 0.0:
        return ridge_solver(columns) @ targets
    weights = [
        ridge_solver(columns * scale[:, None]) @ (scale * target)
        for scale, target in zip(scales.T, targets.T, strict=True)
    ]
    return np.column_stack(weights)
