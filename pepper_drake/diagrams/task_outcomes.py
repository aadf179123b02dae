"""Outcomes of the tasks of a run."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from pepper_drake.results.reach_log import ReachLog
from pepper_drake.results.reach_report import TaskOutcome


def task_outcomes(
    names: Sequence[str], tasks: npt.NDArray[np.int64], log: ReachLog
) -> list[TaskOutcome]:
    """Returns an outcome for each task that was started.

    Args:
        names: Names of all tasks, the reach first.
        tasks: Task number of each logged row (N,).
        log: The run's log.
    """
    outcomes = []
    for number in np.unique(tasks):
        rows = np.flatnonzero(tasks == number)
        outcomes.append(
            TaskOutcome(
                name=names[number],
                began=float(log.time_s[rows[0]]),
                seconds=float(log.time_s[rows[-1]] - log.time_s[rows[0]]),
                final_position_error=float(log.goal_distance_m[rows[-1]]),
                minimum_clearance=float(log.clearance_m[rows].min()),
            )
        )
    return outcomes
