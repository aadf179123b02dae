"""The named terms of a cost: each gives the cost of every step of a movement.

Costs of the end are charged to the last step, costs of the worst moment to its step. The sum over
the steps is the cost, and the sum from a step on is the cost-to-go of policy search.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.optimization.outcome import Outcome
from pepper_drake.short_repr import short_repr

Array = npt.NDArray[np.float64]

HAND_RADIUS = 0.05
"""Radius [m] of the sphere that represents the hand in rollouts without an arm."""

LIMIT_MARGIN = 0.1
"""Margin [rad] to its limit within which a joint has a cost."""


@dataclass(frozen=True, eq=False)
class Task:
    """Task of a movement, in the torso frame T.

    Attributes:
        goal: (3,) of the hand [m].
        demonstrated: (M, 3) the path before the search, evenly spaced in time [m].
        jerk: Mean of the squared jerk of that path [m²/s⁶].
        obstacles: Their distance field, or None.
        clearance: Distance to keep from them [m].
        hand_radius: Of the sphere that represents the hand in rollouts without an arm [m].
    """

    goal: Array
    demonstrated: Array
    jerk: float
    obstacles: PointCloudDistance | None = None
    clearance: float = 0.02
    hand_radius: float = HAND_RADIUS

    __repr__ = short_repr


Term = Callable[[Outcome, Task], Array]
"""Returns (S, N): the cost of each step."""


def hand_to_goal(outcome: Outcome, task: Task) -> Array:
    """Distance of the hand to the goal at the end [m]."""
    costs = np.zeros(outcome.positions.shape[:2])
    if outcome.end_errors is not None:
        costs[:, -1] = outcome.end_errors
    else:
        costs[:, -1] = np.linalg.norm(outcome.positions[:, -1] - task.goal, axis=1)
    return costs


def hand_to_obstacles(outcome: Outcome, task: Task) -> Array:
    """Violation [m] of the clearance by the hand, maximum and mean."""
    if task.obstacles is None:
        raise InputError("cost: hand_to_obstacles needs obstacles")
    gaps = task.obstacles.distance(outcome.positions) - task.hand_radius
    return violation(gaps, task.clearance)


def arm_to_obstacles(outcome: Outcome, task: Task) -> Array:
    """Violation [m] of the clearance by the arm, maximum and mean."""
    return violation(outcome.arm_distances, task.clearance)


def deviation(outcome: Outcome, task: Task) -> Array:
    """Mean distance to the demonstrated path at the same time [m]."""
    count = outcome.positions.shape[1]
    here = np.linspace(0.0, len(task.demonstrated) - 1.0, count)
    grid = np.arange(len(task.demonstrated))
    path = np.column_stack([np.interp(here, grid, axis) for axis in task.demonstrated.T])
    return np.linalg.norm(outcome.positions - path, axis=2) / count


def jerk(outcome: Outcome, task: Task) -> Array:
    """Mean of the squared jerk, as a multiple of that before the search."""
    squares = np.sum(outcome.jerks**2, axis=2)
    return squares / (squares.shape[1] * task.jerk)


def joint_limits(outcome: Outcome, task: Task) -> Array:
    """Depth of joints in the last 0.1 rad before their limits, mean over time, 1 at a limit."""
    if outcome.joints is None or outcome.joint_limits is None:
        raise InputError(
            "cost: joint_limits needs the arm; use kinematics in place of fast rollouts"
        )
    lower, upper = outcome.joint_limits
    room = np.minimum(outcome.joints - lower, upper - outcome.joints)
    depth = np.maximum(0.0, 1.0 - room / LIMIT_MARGIN)
    return depth.sum(axis=2) / depth.shape[1]


def violation(gaps: Array, clearance: float) -> Array:
    """Returns (S, N) [m]: violations by gaps (S, N) as a mean, plus the worst at its step."""
    lacking = np.maximum(0.0, clearance - gaps)
    costs = lacking / lacking.shape[1]
    rows = np.arange(len(costs))
    worst = lacking.argmax(axis=1)
    costs[rows, worst] += lacking[rows, worst]
    return costs


TERMS: dict[str, Term] = {
    "hand_to_goal": hand_to_goal,
    "hand_to_obstacles": hand_to_obstacles,
    "arm_to_obstacles": arm_to_obstacles,
    "deviation": deviation,
    "jerk": jerk,
    "joint_limits": joint_limits,
}
