"""Result of one method in one scene."""

import json
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Self

import numpy as np

from pepper_drake.errors import InputError
from pepper_drake.files import check_fields, read_json, write_atomically

OUTCOMES = ("reached", "touched", "refused", "failed", "error")
"""Outcomes of a run: the hand is at its goal without contact; a link touched an obstacle, whatever
else happened; the reach was refused before the arm moved; it ended before or beside the goal; the
run itself crashed."""


@dataclass
class MethodResult:
    """Result of one run. Lengths in m, angles in rad, times in s; None if not measured."""

    case: str = ""
    method: str = ""
    """The method's letter."""
    outcome: str = "error"
    """One of `OUTCOMES`."""
    reason: str = ""
    message: str = ""
    first_motion_seconds: float | None = None
    """Time until the arm's first motion, including computing time and waiting."""
    planning_seconds: float | None = None
    """Total planning time, including base placement."""
    planning_latency: float | None = None
    """Simulated time from an observation until its plan takes effect, as set in the scenario; None
    for planners without simulated time."""
    replan_seconds_99: float | None = None
    """99th percentile of the wall time of checks, replans and retreats on this computer."""
    touch_speed: float | None = None
    """Relative speed of link and obstacle at the first contact [m/s]."""
    duration: float | None = None
    """Time from the arm's permission to start until the hand rests at its goal."""
    path_length: float | None = None
    jerk: float | None = None
    """Root mean square jerk of the commanded hand path [m/s³]."""
    demonstration_distance: float | None = None
    """Distance to the demonstration, equation 4.1."""
    clearance: float | None = None
    """Smallest true distance between Pepper and an obstacle, at most 0.1."""
    closest_pair: str = ""
    position_error: float | None = None
    orientation_error: float | None = None
    goal_estimate_error: float | None = None
    """Distance between the estimated and the true goal of the hand at the end."""
    realtime_factor: float | None = None
    """Simulated time over the simulation's wall time."""
    wall_seconds: float = 0.0

    def save(self, path: Path) -> None:
        """Writes the result atomically as JSON; non-finite numbers become null."""
        content = {
            key: None if isinstance(value, float) and not np.isfinite(value) else value
            for key, value in asdict(self).items()
        }
        write_atomically(path, json.dumps(content, indent=2) + "\n")

    @classmethod
    def load(cls, path: Path) -> Self:
        """Reads a file that `save` wrote.

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
