"""Interface of reach planners, and their plans."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from pepper_drake.models.control_model import CONTROL_PERIOD, CommandLimits
from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.reach.lean_params import MAX_HIP_PITCH, MIN_HIP_PITCH
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams, ReachTiming
from pepper_drake.planning.reach.separation import StaleSpace
from pepper_drake.short_repr import short_repr, short_signature

Vector = npt.NDArray[np.float64]


def nearest_index(path: Vector, position: Vector) -> int:
    """Returns the index of the configuration of a path (N, 5) nearest to a position (5,) [rad]."""
    return int(np.argmin(np.sum((path - position) ** 2, axis=1)))


class PlanStatus(StrEnum):
    """Result of simulating a reach."""

    CLEAR = "clear"
    OUT_OF_REACH = "out_of_reach"
    NO_CLEAR_PATH = "no_clear_path"
    CANNOT_FOLLOW = "cannot_follow"
    SELF_COLLISION = "self_collision"
    TURNED_AWAY = "turned_away"
    NO_STANDING_ROOM = "no_standing_room"
    NOT_SEEN = "not_seen"


@dataclass(frozen=True, eq=False)
class ReachPlan:
    """A simulated reach.

    Attributes:
        status: CLEAR if the robot may perform it, or the reason against it.
        message: The reason as a sentence.
        base_pose: Pose of the base (3,), x, y, yaw in W [m, rad].
        position_error: Distance of the hand to its goal at the end [m].
        clearance: Least clearance of the arm to the cloud [m].
        joint_path: (N, 5) commands of the arm's joints, every `time_step` [rad].
        movement: The movement to perform.
        collision_checked: Whether the path is checked against later clouds, too.
        time_step: Time between the commands [s].
        unseen: (K, 3) largest unseen region in W [m] of the volume swept by the arm or, for a base
            placement, by the whole robot on its drive.
        out_of_view: Volume of it that cannot be seen from the present base pose [m³].
        hip_pitch: Hip angle to lean to at a base placement [rad]; None to stay as now.
        look_at: Point at which the head should look to see the unseen space (3,) in W [m]; NaN if
            all was seen.
        p_WO: Position of the goal object (3,) in W that it leads to [m]; None if nothing is said
            of it.
        following_error: Largest distance of the hand to its reference on the path [m].
    """

    __repr__ = short_repr
    __signature__ = short_signature

    status: PlanStatus
    message: str
    base_pose: Vector
    position_error: float = np.inf
    clearance: float = -np.inf
    joint_path: Vector | None = None
    movement: Movement | None = None
    collision_checked: bool = True
    time_step: float = CONTROL_PERIOD
    unseen: Vector = field(default_factory=lambda: np.zeros((0, 3)))
    out_of_view: float = 0.0
    hip_pitch: float | None = None
    look_at: Vector = field(default_factory=lambda: np.full(3, np.nan))
    p_WO: Vector | None = None
    following_error: float = 0.0

    def invalid_reason(self, p_WO: Vector, reach: float, tolerance: float) -> str | None:
        """Returns a sentence about a value that no correct planner returns, or None.

        Args:
            p_WO: Position of the goal object (3,) in W when the planner was asked [m].
            reach: Largest distance of the base from the goal within the arm's reach [m].
            tolerance: Largest distance of the plan's goal object from it [m].
        """
        if not np.isfinite(self.base_pose).all():
            return "the planner gave a base pose that is not a number"
        distance = float(np.linalg.norm(self.base_pose[:2] - p_WO[:2]))
        if distance > reach:
            return f"the planner placed the base {distance:.1f} m from the goal"
        if self.hip_pitch is not None:
            if not np.isfinite(self.hip_pitch):
                return "the planner gave a hip angle that is not a number"
            if not MIN_HIP_PITCH <= self.hip_pitch <= MAX_HIP_PITCH:
                return f"the planner gave a hip angle of {self.hip_pitch:.2f} rad"
        if self.joint_path is not None and not np.isfinite(self.joint_path).all():
            return "the planner gave joint angles that are not numbers"
        off = 0.0 if self.p_WO is None else float(np.linalg.norm(self.p_WO - p_WO))
        if not off <= tolerance:
            return (
                f"the planner led the hand to a goal {1000 * off:.0f} mm from the one that is seen"
            )
        return None

    def nearest(self, arm: ArmState) -> int:
        """Returns the index of the path's command nearest to the arm's."""
        assert self.joint_path is not None
        return nearest_index(self.joint_path, arm.position)

    def predict(
        self,
        arm: ArmState,
        elapsed: float,
        duration: float,
        speed: float = 1.0,
        timing_error: float = ReachTiming.timing_error,
    ) -> ArmState:
        """Returns the arm's command after some time along this path.

        Its present deviation from the path, in position and velocity, is assumed to persist.

        Args:
            arm: The present command.
            elapsed: Elapsed time of the movement [s], as a path that turns back passes the same
                place twice.
            duration: Time from now [s].
            speed: Time scaling of the movement: 1 at full speed.
            timing_error: Largest lead or lag on the path that is accounted for [s].
        """
        path = self.joint_path
        assert path is not None
        half = round(timing_error / self.time_step)
        first = min(max(round(elapsed / self.time_step) - half, 0), len(path) - 1)
        some = path[first : first + 2 * half + 1]
        now = first + int(np.argmin(np.sum((some - arm.position) ** 2, axis=1)))
        later = min(now + round(speed * duration / self.time_step), len(path) - 1)
        rates = np.diff(path, axis=0, append=path[-1:]) / self.time_step
        return ArmState(
            arm.position + path[later] - path[now],
            arm.velocity + speed * (rates[later] - rates[now]),
        )


class RemainingClearance(NamedTuple):
    """Distances of the rest of a path to obstacles.

    Attributes:
        times: (N,) from now on [s].
        distances: (N,) of the arm to obstacles, infinite where nothing is near [m].
    """

    times: Vector
    distances: Vector

    @property
    def minimum(self) -> float:
        """The least distance [m]."""
        return float(self.distances.min())

    def within(self, duration: float) -> float:
        """Returns the least distance within some time from now [m]."""
        return float(self.distances[self.times <= duration].min(initial=np.inf))

    def time_below(self, clearance: float) -> float:
        """Returns the time until the distance is first below a clearance [m]; infinite if never."""
        return float(self.times[self.distances < clearance].min(initial=np.inf))


class Planner(Protocol):
    """Interface of a planner to the supervision; planners are stateless."""

    @property
    def demonstrated(self) -> Movement:
        """The movement as it was demonstrated."""
        ...

    @property
    def params(self) -> ReachPlannerParams:
        """Criteria of a good reach."""
        ...

    @property
    def limits(self) -> CommandLimits:
        """Limits of the arm's joint commands."""
        ...

    def plan_base_placement(self, observation: Observation) -> ReachPlan:
        """Returns the best plan over all base placements.

        It is clear, or nearly so, if there is such a placement, and must be checked again there
        with `check_reach`.
        """
        ...

    def look_along_drive(self, observation: Observation) -> Vector:
        """Returns where to look (3,), in W, before the base placement is known [m].

        It shows most of the unseen space that the robot would sweep on its drive to the most
        comfortable place, whether there is room or not; NaN if all of it was seen.
        """
        ...

    def check_drive(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns a clear base placement with the result of checking the drive there again.

        Its status is NOT_SEEN if the drive would sweep unseen space, and NO_STANDING_ROOM if an
        obstacle blocks it.
        """
        ...

    def check_reach(self, observation: Observation, movement: Movement | None = None) -> ReachPlan:
        """Returns the best plan from the present base pose.

        Args:
            observation: The observation; the arm is at rest.
            movement: The movement to try first: that of `plan_base_placement` or, if omitted, the
                demonstrated one. If it is not clear, it is adapted.
        """
        ...

    def replan(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns the best plan for the rest of a movement, from the arm's command and velocity.

        It is the rest of the old movement if that is clear, and not clear if no plan is.
        """
        ...

    def plan_retreat(self, travelled: Vector, observation: Observation) -> ReachPlan:
        """Returns a plan back along the travelled path to where there is more clearance.

        Its end is not the goal; it is the best that can be done, clear or not.

        Args:
            travelled: The path (N, 5) on which the arm came [rad].
            observation: The observation.
        """
        ...

    def plan_return(
        self, travelled: Vector, posture: Vector, observation: Observation
    ) -> ReachPlan:
        """Returns a plan back to a posture of the arm, not clear if there is none.

        Args:
            travelled: The path (N, 5) on which the arm came [rad].
            posture: The posture (5,) [rad].
            observation: The observation.
        """
        ...

    def remaining_clearance(self, plan: ReachPlan, observation: Observation) -> RemainingClearance:
        """Returns distances of the rest of a plan's path to obstacles."""
        ...

    def stale_space(
        self, plan: ReachPlan, observation: Observation, new_obstacle: Vector, movable: Vector
    ) -> StaleSpace:
        """Returns space that the arm sweeps soon and that was not seen recently.

        Args:
            plan: The running plan.
            observation: The observation.
            new_obstacle: (N, 3) points of an obstacle that appeared since the start, in W [m].
            movable: (M, 3) points of objects that move, or hung in the air at the start [m].
        """
        ...


def quality(plan: ReachPlan, params: ReachPlannerParams) -> tuple[bool, bool, bool, float, float]:
    """Returns a sort key of plans: clear, arriving, followed closely, clearance, duration."""
    arrives = plan.status in (PlanStatus.CLEAR, PlanStatus.NO_CLEAR_PATH)
    return (
        plan.status == PlanStatus.CLEAR,
        arrives,
        plan.following_error <= params.following.good,
        min(plan.clearance, params.clearance.want) if arrives else -plan.position_error,
        -plan.movement.primitive.duration if plan.movement is not None else -np.inf,
    )
