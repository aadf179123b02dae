"""A planner that fails as a fault says."""

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
"""Distance of a base placement that is garbage [m]."""
_BEFORE = ("plan_base_placement", "check_reach")
"""Questions for a plan while the arm rests."""
_ON_THE_WAY = ("replan", "plan_retreat")
"""Questions for a plan while it moves."""
T = TypeVar("T")


@dataclass(frozen=True)
class FaultyPlanner(PlannerWrapper):
    """A `Planner` that hands all questions on, and spoils the answers while its fault lasts.

    Off: nothing is found. Intermittent: every other time nothing is found. Wrong: planned for a
    goal that is elsewhere. Garbage: places out of the world, paths that are no numbers. A fault
    that waits for the arm begins with the first question about a movement on its way.

    Attributes:
        fault: Of the signal "planner".
        seed: What is drawn follows from it and from the time of the question.
    """

    fault: Fault
    seed: int = 0

    def _answer(self, name: str, observation: Observation, ask: Callable[[Observation], T]) -> T:
        on_the_way = name in _ON_THE_WAY
        if not on_the_way and name not in _BEFORE:
            return ask(observation)
        answer = ask(self._asked(observation, on_the_way))
        assert isinstance(answer, ReachPlan)
        return cast(T, self._spoilt(answer, observation, on_the_way))

    def _is_active(self, observation: Observation, on_the_way: bool) -> bool:
        if np.isnan(self.fault.start):
            return on_the_way
        since = observation.time - self.fault.start
        return 0.0 <= since < self.fault.duration

    def _draw(self, observation: Observation) -> np.random.Generator:
        return np.random.default_rng((self.seed, round(1000.0 * observation.time)))

    def _asked(self, observation: Observation, on_the_way: bool) -> Observation:
        """The question, with the goal elsewhere for a wrong answer."""
        if self.fault.kind != "wrong" or not self._is_active(observation, on_the_way):
            return observation
        direction = np.random.default_rng(self.seed).normal(size=3)
        offset = SIGNALS["planner"].offset * direction / np.linalg.norm(direction)
        moved = RigidTransform(observation.X_WO.rotation(), observation.p_WO + offset)
        return replace(observation, X_WO=moved)

    def _spoilt(self, plan: ReachPlan, observation: Observation, on_the_way: bool) -> ReachPlan:
        if not self._is_active(observation, on_the_way):
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
    """Returns a planner and its timing as the fault of the signal "planner" has them.

    One that is to be slow takes five times as long, from the start.
    """
    fault = faults.fault("planner")
    if fault is None:
        return planner, timing
    if fault.kind == "slow":
        slow = {name: 5.0 * seconds for name, seconds in vars(timing.latency).items()}
        timing = replace(timing, latency=PlanningLatency(**slow))
    return FaultyPlanner(planner, fault, faults.seed), timing
