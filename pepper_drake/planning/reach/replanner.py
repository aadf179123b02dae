"""What the arm does on its way about what comes in it: go on, go around, step aside, wait."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pepper_drake.planning.reach.reach_plan import PlanStatus, ReachPlan
from pepper_drake.planning.reach.reach_planner import ReachPlanner
from pepper_drake.planning.reach.reach_state import ReachState, ReachTiming
from pepper_drake.planning.trajectories.retreat import (
    MOVING_SIDE,
    dilate_new_points,
    extrude_new_points_down,
)

Vector = npt.NDArray[np.float64]

_STILL = 0.1
"""Joint speed below which the arm waits [rad/s]."""


@dataclass(frozen=True)
class Observation:
    """What is known when a new cloud is there.

    Attributes:
        seen: The planner's arguments; its joints are those commanded.
        coming: (P, 3) where what moves near the goal will be soon, in W [m].
        joint_velocity: (5,) the arm's as commanded [rad/s].
        time: s.
    """

    seen: dict[str, Any]
    predicted_points: Vector
    joint_velocity: Vector
    time: float

    @property
    def p_WO(self) -> Vector:
        """(3,) the goal object [m]."""
        position: Vector = self.seen["X_WO"].translation()
        return position

    @property
    def cloud_W(self) -> Vector:
        """(P, 3) what was seen, and where what moves will be soon [m]."""
        return np.concatenate((self.seen["cloud_W"], self.predicted_points))

    def with_cloud(self, cloud_W: Vector) -> dict[str, Any]:
        """The planner's arguments among other obstacles (P, 3) [m]."""
        return {**self.seen, "cloud_W": cloud_W}


@dataclass(frozen=True)
class ReachReplanner:
    """Holds each new cloud against the rest of a movement.

    When something is in the way, another way is planned; if there is none, or if it moves, the arm
    withdraws to where there is room, waits, and goes on when the way is free.

    Attributes:
        planner: What finds other ways.
        timing: How near is too near, and how long is waited.
    """

    planner: ReachPlanner
    timing: ReachTiming

    def is_free(self, plan: ReachPlan, seen: dict[str, Any]) -> bool:
        """Whether the rest of a plan's way is."""
        timing = self.timing
        enough = min(timing.remaining_clearance, plan.clearance - timing.clearance_lost)
        return bool(self.planner.remaining_clearance(plan, **seen) >= enough)

    def __call__(self, progress: ReachState, sight: Observation) -> ReachState:
        """Returns the progress after a cloud; the same movement if its way is free."""
        plan, cloud = progress.plan, sight.cloud_W
        assert plan is not None
        has_waited = self._has_waited(progress, sight.time)
        if has_waited and not len(sight.predicted_points):
            # What stands there and does not go is no newcomer any more.
            progress = replace(progress, planned_cloud=cKDTree(cloud))
        if progress.planned_cloud is not None:
            if len(sight.predicted_points):
                cloud = dilate_new_points(cloud, progress.planned_cloud, sight.p_WO, MOVING_SIDE)
            cloud = extrude_new_points_down(cloud, progress.planned_cloud, sight.p_WO)
        seen = sight.with_cloud(cloud)
        reach = plan if progress.suspended_plan is None else progress.suspended_plan
        is_free = self.is_free(reach, seen)
        if is_free and progress.suspended_plan is None:
            return progress
        # What moves is given time: where it goes is not known well enough to pass it.
        is_sudden = progress.suspended_plan is None and not len(sight.predicted_points)
        if is_free or has_waited or is_sudden:
            other = self._other_way(progress, reach, sight, seen, is_free)
            if other.status == PlanStatus.CLEAR and self._is_enough(progress, reach, other):
                return replace(progress.with_plan(other, sight.time), suspended_plan=None)
            progress = replace(progress, checked=sight.time)
        return self._retreat(progress, plan, reach, sight, seen)

    def _is_enough(self, progress: ReachState, reach: ReachPlan, other: ReachPlan) -> bool:
        """Whether a way is wide enough for an arm that could as well go on waiting."""
        enough = min(self.timing.remaining_clearance, reach.clearance - self.timing.clearance_lost)
        return progress.suspended_plan is None or other.clearance >= enough

    def _has_waited(self, progress: ReachState, time: float) -> bool:
        """Whether the arm stepped aside, or last sought a way around in vain, long ago."""
        last = max(progress.since, progress.checked)
        return progress.suspended_plan is not None and time - last >= self.timing.detour_delay

    def _other_way(
        self,
        progress: ReachState,
        reach: ReachPlan,
        sight: Observation,
        seen: dict[str, Any],
        is_free: bool,
    ) -> ReachPlan:
        """The best way on from here; not close by the sides of what came, unless it is gone."""
        if progress.planned_cloud is not None and not is_free:
            sides = dilate_new_points(sight.cloud_W, progress.planned_cloud, sight.p_WO)
            seen = sight.with_cloud(
                extrude_new_points_down(sides, progress.planned_cloud, sight.p_WO)
            )
        other = self.planner.replan(reach, joint_velocity=sight.joint_velocity, **seen)
        is_at_rest = (
            progress.suspended_plan is not None and np.abs(sight.joint_velocity).max() < _STILL
        )
        if is_at_rest and other.clearance < self.timing.clearance_resumed:
            anew = self.planner.check_reach(**seen)
            if anew.status == PlanStatus.CLEAR and anew.clearance > other.clearance:
                return anew
        return other

    def _retreat(
        self,
        progress: ReachState,
        plan: ReachPlan,
        reach: ReachPlan,
        sight: Observation,
        seen: dict[str, Any],
    ) -> ReachState:
        """Steps aside, or stays where the arm is out of the way already."""
        if progress.suspended_plan is not None and self.is_free(plan, seen):
            return progress
        if progress.planned_cloud is not None:
            # What has left its place may come back to it.
            seen = sight.with_cloud(np.concatenate((seen["cloud_W"], progress.planned_cloud.data)))
        withdrawal = self.planner.plan_retreat(plan, joint_velocity=sight.joint_velocity, **seen)
        if progress.suspended_plan is not None and withdrawal.clearance <= (
            self.planner.remaining_clearance(plan, **seen)
        ):
            return progress  # Nowhere is better than where the arm is going.
        return replace(progress.with_plan(withdrawal, sight.time), suspended_plan=reach)
