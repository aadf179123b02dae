"""The results of one reach, from its log and the ground truth."""

import json
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.errors import InputError
from pepper_drake.files import check_fields, read_json
from pepper_drake.results.movement_report import MovementReport

Vector = npt.NDArray[np.float64]


@dataclass
class CloudReport:
    """Quality of the obstacle cloud against the truth at the time when the arm started."""

    points: int = 0
    rms_error: float | None = None
    """Root mean square distance of the points to the true surfaces [m]; None without points."""
    robot_points: int = 0
    """Points that lie on Pepper itself."""
    goal_points: int = 0
    """Points that lie on the goal object."""


@dataclass
class TaskOutcome:
    """Outcome of one task of a run: of the reach, or of a task after it."""

    name: str = ""
    began: float = 0.0
    """Start time."""
    seconds: float = 0.0
    """Duration."""
    final_position_error: float = 0.0
    """Distance between the hand and its true goal at the end."""
    minimum_clearance: float = 0.0
    """Smallest signed distance between Pepper and obstacles during the task."""


@dataclass
class ReachReport:
    """Contents of `report.json`. Errors are against the truth, in m, rad and s."""

    outcome: str = "failed"
    """"reached", "reached_unconfirmed" (at the goal, which was not seen recently) or "failed"."""
    reason: str = ""
    """Reason of a failure, in one word; empty without one."""
    message: str = ""
    """The reason as a sentence."""
    scene: str = ""
    arm: str = ""
    seed: int = 0
    coupling: str = ""
    final_position_error: float | None = None
    """Distance between the hand and the true pre-grasp pose at the end."""
    final_orientation_error: float | None = None
    """Angle between the two. Five joints cannot reach every pose: position has priority."""
    final_axis_error: float | None = None
    """The same for the hand's axis that matters for the task, the scene's `goal.pre_grasp.axis`."""
    axis_tolerance: float | None = None
    """Largest error of that axis at which the hand counts as at its goal."""
    movement: MovementReport = field(default_factory=MovementReport)
    """The movement as it was performed: as shown, bent or adapted."""
    goal_estimate_error: float | None = None
    """Distance between the estimated and the true pre-grasp position at the end."""
    minimum_clearance: float | None = None
    """Smallest signed distance between any link of Pepper and any obstacle over the whole run."""
    closest_pair: str = ""
    """Link and obstacle with the smallest clearance."""
    contacts: int | None = 0
    """Time steps (of 20 ms) with a link in contact with an obstacle; this and the next fields are
    None if not measured."""
    touch_speed: float | None = None
    """Relative speed of link and obstacle at the first contact; None without one."""
    own_touch_speed: float | None = None
    """The link's share of that speed."""
    contact_force: float | None = 0.0
    """Largest force between Pepper and obstacles [N]."""
    goal_force: float | None = 0.0
    """Largest force between Pepper and the goal object [N]."""
    arm_speed: float | None = 0.0
    """Largest speed of a point of the reaching arm, relative to the torso."""
    command_acceleration: float | None = 0.0
    """Largest acceleration of a joint's commands [rad/s^2]."""
    stopping_seconds: float | None = None
    """Time from a failure until arms, body and base stood still; None if the run ended before."""
    tasks: list[TaskOutcome] = field(default_factory=list)
    """The reach, and the tasks that were started after it."""
    faults: list[str] = field(default_factory=list)
    """The faults that were injected, as SIGNAL:KIND@START[+DURATION]."""
    unseen_volume: float = 0.0
    """Unseen part of the arm's swept volume in the last plan [m³]; 0 unless that was accepted."""
    out_of_view_volume: float = 0.0
    """The same for space close to the chest that no head angle brings into view [m³]."""
    drive_out_of_view_volume: float = 0.0
    """The same for the whole robot's swept volume in its last drive [m³]: mostly low and near."""
    tracking_error_rms: float | None = None
    """Root mean square distance between the hand and the primitive's position during the reach."""
    planning_seconds: float | None = None
    """Computing time between the robot's arrival and the arm's start."""
    planning_delay: float | None = None
    """Simulated time that the arm waited for its plan after the robot had settled."""
    cloud: CloudReport = field(default_factory=CloudReport)
    simulated_seconds: float = 0.0
    wall_seconds: float = 0.0
    realtime_factor: float = 0.0
    versions: dict[str, str] = field(default_factory=dict)

    def save(self, path: Path) -> None:
        """Writes the report as JSON; non-finite numbers become null."""
        path.write_text(json.dumps(_finite(asdict(self)), indent=2) + "\n")

    @classmethod
    def load(cls, path: Path) -> "ReachReport":
        """Reads a file that `save` wrote.

        Raises:
            InputError: The file is missing or is not a report of a reach.
        """
        data = read_json(path)
        try:
            cloud = CloudReport(**data.pop("cloud"))
            movement = MovementReport(**data.pop("movement"))
            report = cls(**data, cloud=cloud, movement=movement)
        except (AttributeError, KeyError, TypeError):
            raise InputError(f"{path}: this is not a report of a reach; run it again") from None
        check_fields(report, str(path), "run it again")
        return report

    def summary(self) -> str:
        """Returns a few lines for the terminal."""
        lines = [f"{self.outcome}" + (f": {self.message}" if self.message else "")]
        lines.extend(self.movement.lines(coupled=self.coupling != "none"))
        if self.final_position_error is not None:
            lines.append(
                f"  hand to goal      {1000 * self.final_position_error:6.1f} mm"
                + (
                    f"   (goal estimate {1000 * self.goal_estimate_error:.1f} mm)"
                    if self.goal_estimate_error is not None
                    else ""
                )
            )
        lines.extend(self._orientation_lines())
        if self.minimum_clearance is not None:
            lines.append(
                f"  least clearance   {1000 * self.minimum_clearance:6.1f} mm"
                f"   ({self.contacts} steps in contact"
                + (f"; {self.closest_pair})" if self.closest_pair else ")")
            )
        if self.arm_speed is not None:
            force = max(self.contact_force or 0.0, self.goal_force or 0.0)
            lines.append(
                f"  fastest arm point {1000 * self.arm_speed:6.0f} mm/s"
                f"   (largest force {force:.0f} N)"
            )
        if self.touch_speed is not None:
            lines.append(f"  speed at touch    {1000 * self.touch_speed:6.0f} mm/s")
        for volume, line in (
            (self.unseen_volume, "unseen space      {:6.1f} litres passed by the arm"),
            (self.out_of_view_volume, "out of view       {:6.1f} litres passed by the arm"),
            (self.drive_out_of_view_volume, "                  {:6.1f} litres passed by the base"),
        ):
            if volume > 0.0:
                lines.append("  " + line.format(1000 * volume))
        for task in self.tasks[1:]:
            lines.append(
                f"  {task.name:17} {1000 * task.final_position_error:6.1f} mm to its goal, "
                f"{1000 * task.minimum_clearance:.1f} mm clear, in {task.seconds:.1f} s"
            )
        lines.extend(f"  injected          {fault}" for fault in self.faults)
        if self.tracking_error_rms is not None:
            lines.append(f"  tracking error    {1000 * self.tracking_error_rms:6.1f} mm rms")
        lines.append(
            f"  simulated {self.simulated_seconds:.1f} s in {self.wall_seconds:.1f} s"
            f" ({self.realtime_factor:.1f} times real time)"
        )
        return "\n".join(lines)

    def _orientation_lines(self) -> list[str]:
        """Returns lines on the hand's final orientation, and the reason for its error."""
        whole, axis, tolerance = (
            self.final_orientation_error,
            self.final_axis_error,
            self.axis_tolerance,
        )
        if whole is None or axis is None or tolerance is None:
            return []
        return [
            f"  task axis error   {np.degrees(axis):6.1f}°"
            f"    (allowed {np.degrees(tolerance):.0f}°)",
            f"  whole orientation {np.degrees(whole):6.1f}°    (an arm of five joints cannot take "
            "every orientation at a position)",
        ]


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def pose_error(X_WA: RigidTransform, X_WB: RigidTransform) -> tuple[float, float]:
    """Returns the distance [m] and the angle [rad] between two poses."""
    distance = float(np.linalg.norm(X_WA.translation() - X_WB.translation()))
    angle = (X_WA.rotation().inverse() @ X_WB.rotation()).ToAngleAxis().angle()
    return distance, float(abs(angle))
