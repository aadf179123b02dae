"""Result of one method in one scene."""

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Self

import numpy as np

from pepper_drake.errors import InputError
from pepper_drake.files import check_fields, read_json, write_atomically

OUTCOMES = ("reached", "touched", "refused", "failed", "error")
"""Outcomes of a run: the hand is at its goal and nothing was touched; a link touched an
obstacle, whatever else happened; it was declined before the arm moved; it ended on the way, or
elsewhere than at the goal; the run itself broke down."""


@dataclass
class MethodResult:
    """One run. Lengths in m, angles in rad, times in s; None where there is no such number."""

    case: str = ""
    method: str = ""
    """The method's letter."""
    outcome: str = "error"
    """One of `OUTCOMES`."""
    reason: str = ""
    message: str = ""
    first_motion_seconds: float | None = None
    """From when the arm may start to its first command: computing time and periods waited."""
    planning_seconds: float | None = None
    """All time spent on planning, places to stand included."""
    planning_latency: float | None = None
    """Simulated time from a look to the effect of the plan made from it, as the scenario sets it;
    None for a planner without a clock."""
    replan_seconds_99: float | None = None
    """99th percentile of the wall time that checks, replans and retreats took on this computer."""
    touch_speed: float | None = None
    """Speed of link and obstacle against each other at the first touch [m/s]."""
    duration: float | None = None
    """From when the arm may start until the hand rests at its goal."""
    path_length: float | None = None
    jerk: float | None = None
    """Root mean square of the commanded hand's [m/s³]."""
    demonstration_distance: float | None = None
    """Distance to the demonstration, equation 4.1."""
    clearance: float | None = None
    """Least true distance between Pepper and an obstacle, cut at 0.1."""
    closest_pair: str = ""
    position_error: float | None = None
    orientation_error: float | None = None
    goal_estimate_error: float | None = None
    """Between the estimated and the true goal of the hand at the end."""
    realtime_factor: float | None = None
    """Simulated time over the simulation's wall time."""
    wall_seconds: float = 0.0

    def save(self, path: Path) -> None:
        """Writes the result as JSON, whole or not at all; what is not finite becomes null."""
        content = {
            key: None if isinstance(value, float) and not np.isfinite(value) else value
            for key, value in asdict(self).items()
        }
        write_atomically(path, json.dumps(content, indent=2) + "\n")

    @classmethod
    def load(cls, path: Path) -> Self:
        """Reads what `save` wrote.

        Raises:
            InputError: The file is not a result.
        """
        mend = "remove it and run again"
        try:
            content: dict[str, Any] = read_json(path)
            result = cls(**content)
        except (InputError, TypeError):
            raise InputError(
                f"{path}: this is not a result with the fields "
                f"{', '.join(field.name for field in fields(cls))}; {mend}"
            ) from None
        check_fields(result, str(path), mend)
        if result.outcome not in OUTCOMES:
            raise InputError(f'{path}: outcome is "{result.outcome}"; {mend}')
        return result
