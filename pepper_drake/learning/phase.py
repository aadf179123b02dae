"""The canonical system of a discrete motion: a phase that falls from one towards zero.

tau x' = -alpha_x x / (1 + slowdown), x(0) = 1 (equation 2.5 of the report; the slowdown is the
phase stopping of Ijspeert et al. 2013, section 2.4, doi:10.1162/NECO_a_00393). Relative time s
(time divided by duration) and phase are equivalent: x = exp(-alpha_x s). All learned functions
depend on the phase alone, so another canonical system (a rhythmic one) only needs its own phase and
features.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Scalar = Any  # A float, or an AutoDiffXd for gradients.

ALPHA_Z = 25.0
"""Default constant of the spring: its step response settles to 1e-4 within one tau."""

PHASE_RATIO = 3.0
"""alpha_x = alpha_z / 3, the report's choice."""

GOAL_THRESHOLD = 0.003
"""A goal counts as moved when it is further than this from its last position [m]."""


def phase_at(relative_times: npt.ArrayLike, alpha_x: float) -> Array:
    """Returns the phase x in (0, 1] at relative times (0 at the start, 1 at the end)."""
    return np.exp(-alpha_x * np.asarray(relative_times, dtype=float))


def hold(phases: Array, least: float) -> Array:
    """Returns the phases, but not less than `least`; for AutoDiffXd and Expression as well."""
    if phases.dtype == object:
        return 0.5 * (phases + least + np.abs(phases - least))
    return np.maximum(phases, least)


def fade_out(phases: npt.ArrayLike, alpha_x: float) -> Array:
    """Returns one during the motion and (x / x_end)³ after it, (N,), which ends any forcing term.

    It falls like exp(-alpha_z t / tau), faster than the spring settles, so that the forcing term's
    final value does not keep the hand from its goal.
    """
    x = np.asarray(phases)
    return (x / hold(x, np.exp(-alpha_x))) ** 3


def gate(phases: npt.ArrayLike, alpha_x: float) -> Array:
    """Returns x during the motion and x (x / x_end)² after it, (N,)."""
    x = np.asarray(phases)
    late = x / hold(x, np.exp(-alpha_x))
    return x * late * late


def relative_time_at(phases: npt.ArrayLike, alpha_x: float) -> Array:
    """Returns the relative time of phases: the inverse of `phase_at`."""
    return -np.log(np.asarray(phases, dtype=float)) / alpha_x


def extended_tau(
    tau: Scalar, nominal: Scalar, first_goal: Array, seen_goal: Array, extension: float
) -> Scalar:
    """Extends the duration in proportion to the goal's displacement since the motion began.

    Only the goal's distance from its first position counts, not its path length, so that a noisy
    estimate of the goal does not lengthen the motion more and more.

    Args:
        tau: The duration so far [s].
        nominal: The duration without a displacement [s].
        first_goal: (3,) goal at the start of the motion [m].
        seen_goal: (3,) current goal [m].
        extension: Time for each metre of displacement [s/m].

    Returns:
        The duration [s], never less than `tau`; unchanged while the goal is within `GOAL_THRESHOLD`
        of the first one.
    """
    displacement = seen_goal - first_goal
    square = displacement @ displacement
    if square <= GOAL_THRESHOLD**2:
        return tau
    extended = nominal + extension * np.sqrt(square)
    return extended if extended > tau else tau
