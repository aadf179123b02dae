"""A planner with an injected fault."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar, cast

import numpy as np
from pydrake.math import RigidTransform

from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.planner_wrapper import PlannerWrapper
from pepper_drake.planning.reach.reach_parameters import PlanningLatency, ReachTiming
from pepper_drake.planning.reach.reach_plan import Planner, PlanStatus, ReachPlan
from pepper_drake.systems.faults.fault import SIGNALS, Fault
from pepper_drake.systems.faults.fault_set import FaultSet

_FAR = 1e3
"""Standard deviation of a garbage base placement [m]."""
_AT_REST = ("plan_base_placement", "check_reach")
"""Requests made while the arm rests."""
_DURING_MOTION = ("replan", "plan_retreat", "plan_return")
"""Requests made while the arm moves."""
T = TypeVar("T")


@dataclass(frozen=True)
class FaultyPlanner(PlannerWrapper):
    """Forwards all requests to a `Planner`, and corrupts the plans while its fault is active.

    Off: no plan is found. Intermittent: every other time no plan is found, at random. Wrong: plans
    for a displaced goal. Garbage: base placements far away, joint paths of NaN. A fault that waits
    for the arm affects only requests made while it moves.

    Attributes:
        fault: Fault of the signal "planner".
        seed: Random numbers follow from it and from the time of the request.
    """

    fault: Fault
    seed: int = 0

    def _answer(self, name: str, observation: Observation, ask: Callable[[Observation], T]) -> T:
        is_moving = name in _DURING_MOTION
        if not is_moving and name not in _AT_REST:
            return ask(observation)
        answer = ask(self._altered_observation(observation, is_moving))
        assert isinstance(answer, ReachPlan)
        return cast(T, self._corrupted(answer, observation, is_moving))

    def _is_active(self, observation: Observation, is_moving: bool) -> bool:
        if np.isnan(self.fault.start):
            return is_moving
        since = observation.time - self.fault.start
        return 0.0 <= since < self.fault.duration

    def _draw(self, observation: Observation) -> np.random.Generator:
        return np.random.default_rng((self.seed, round(1000.0 * observation.time)))

    def _altered_observation(self, observation: Observation, is_moving: bool) -> Observation:
        """Returns the observation, with the goal displaced for the kind "wrong"."""
        if self.fault.kind != "wrong" or not self._is_active(observation, is_moving):
            return observation
        direction = np.random.default_rng(self.seed).normal(size=3)
        offset = SIGNALS["planner"].offset * direction / np.linalg.norm(direction)
        moved = RigidTransform(observation.X_WO.rotation(), observation.p_WO + offset)
        return replace(observation, X_WO=moved)

    def _corrupted(self, plan: ReachPlan, observation: Observation, is_moving: bool) -> ReachPlan:
        if not self._is_active(observation, is_moving):
            return plan
        kind, draw = self.fault.kind, self._draw(observation)
        if kind == "off" or (kind == "intermittent" and draw.random() < 0.5):
            return ReachPlan(
                PlanStatus.NO_CLEAR_PATH, "the planner gave no plan", observation.base_pose
            )
        if kind == "garbage":
            path = plan.joint_path
            return replace(
                plan,
                status=PlanStatus.CLEAR,
                base_pose=_FAR * draw.normal(size=3),
                joint_path=None if path is None else np.full_like(path, np.nan),
            )
        return plan


def faulty(planner: Planner, timing: ReachTiming, faults: FaultSet) -> tuple[Planner, ReachTiming]:
    """Returns a planner and its timing with the fault of the signal "planner".

    A slow planner takes five times as long, from the start of the run.
    """
    fault = faults.fault("planner")
    if fault is None:
        return planner, timing
    if fault.kind == "slow":
        slow = {name: 5.0 * seconds for name, seconds in vars(timing.latency).items()}
        timing = replace(timing, latency=PlanningLatency(**slow))
    return FaultyPlanner(planner, fault, faults.seed), timing
