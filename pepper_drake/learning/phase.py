"""The canonical system of a discrete motion: a phase that falls from one towards zero.

tau x' = -alpha_x x / (1 + slowdown), x(0) = 1 (equation 2.5 of the report; the slowdown is the
phase stopping of Ijspeert et al. 2013, section 2.4, doi:10.1162/NECO_a_00393). Time divided by the
motion's duration, here called relative time, and phase are two names of one thing:
x = exp(-alpha_x s). Everything that is learned is a function of the phase, so another canonical
system (a rhythmic one) only has to bring its own phase and its own features of it.
"""

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Scalar = Any  # A float, or an AutoDiffXd where gradients are asked for.

ALPHA_Z = 25.0
"""Default constant of the spring: it settles to 1e-4 of a step within one tau."""

PHASE_RATIO = 3.0
"""alpha_x = alpha_z / 3, the report's choice."""

GOAL_THRESHOLD = 0.003
"""A goal counts as moved when it is further than this from where it was, in m."""


def phase_at(relative_times: npt.ArrayLike, alpha_x: float) -> Array:
    """Returns the phase x in (0, 1] at relative times (0 at the start, 1 at the end)."""
    return np.exp(-alpha_x * np.asarray(relative_times, dtype=float))


def hold(phases: Array, least: float) -> Array:
    """Returns the phases, but not less than `least`; for AutoDiffXd and Expression as well."""
    if phases.dtype == object:
        return 0.5 * (phases + least + np.abs(phases - least))
    return np.maximum(phases, least)


def fade_out(phases: npt.ArrayLike, alpha_x: float) -> Array:
    """Returns one during the motion and (x / x_end)³ after it, (N,): ends any forcing term.

    It then falls like exp(-alpha_z t / tau), faster than the spring settles, so that what the
    forcing term was at the end does not keep the hand from its goal.
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

    What counts is how far the goal is from where it was at first, not the way that it went: a goal
    whose estimate shakes does not make the motion longer and longer.

    Args:
        tau: The duration so far [s].
        nominal: The duration without a displacement [s].
        first_goal: (3,) where the goal was when the motion began [m].
        seen_goal: (3,) where it is now [m].
        extension: Time for each metre of displacement [s/m].

    Returns:
        The duration [s], never less than `tau`: what was given is not taken back. It stays while
        the goal is within `GOAL_THRESHOLD` of the first one.
    """
    displacement = seen_goal - first_goal
    square = displacement @ displacement
    if square <= GOAL_THRESHOLD**2:
        return tau
    extended = nominal + extension * np.sqrt(square)
    return extended if extended > tau else tau
