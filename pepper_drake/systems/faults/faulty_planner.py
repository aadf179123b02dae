"""A planner that fails as a fault says."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_parameters import (
    PlanningLatency,
    ReachPlannerParams,
    ReachTiming,
)
from pepper_drake.planning.reach.reach_plan import (
    Planner,
    PlanStatus,
    ReachPlan,
    RemainingClearance,
)
from pepper_drake.planning.reach.separation import StaleSpace
from pepper_drake.systems.faults.fault import SIGNALS, Fault
from pepper_drake.systems.faults.fault_set import FaultSet

_FAR = 1e3
"""Distance of a base placement that is garbage [m]."""


@dataclass(frozen=True)
class FaultyPlanner:
    """A `Planner` that hands all questions on, and spoils the answers while its fault lasts.

    Off: nothing is found. Intermittent: every other time nothing is found. Wrong: planned for a
    goal that is elsewhere. Garbage: places out of the world, paths that are no numbers. A fault
    that waits for the arm begins with the first question about a movement on its way.

    Attributes:
        planner: Gives the answers.
        fault: Of the signal "planner".
        seed: What is drawn follows from it and from the time of the question.
    """

    planner: Planner
    fault: Fault
    seed: int = 0

    @property
    def demonstrated(self) -> Movement:
        """The movement as it was demonstrated."""
        return self.planner.demonstrated

    @property
    def params(self) -> ReachPlannerParams:
        """Criteria of a good reach."""
        return self.planner.params

    @property
    def limits(self) -> CommandLimits:
        """Limits of the arm's joint commands."""
        return self.planner.limits

    def plan_base_placement(self, observation: Observation) -> ReachPlan:
        """Returns the best plan from any place where the base can stand; see `Planner`."""
        return self._spoilt(
            self.planner.plan_base_placement(self._asked(observation, False)), observation, False
        )

    def check_reach(self, observation: Observation, movement: Movement | None = None) -> ReachPlan:
        """Returns the best plan from where the base is; see `Planner`."""
        return self._spoilt(
            self.planner.check_reach(self._asked(observation, False), movement), observation, False
        )

    def replan(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns the best plan for the rest of a movement; see `Planner`."""
        return self._spoilt(
            self.planner.replan(plan, self._asked(observation, True)), observation, True
        )

    def plan_retreat(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns a plan back to where there is more clearance; see `Planner`."""
        return self._spoilt(
            self.planner.plan_retreat(plan, self._asked(observation, True)), observation, True
        )

    def remaining_clearance(self, plan: ReachPlan, observation: Observation) -> RemainingClearance:
        """Returns distances of the rest of a plan's path to obstacles; see `Planner`."""
        return self.planner.remaining_clearance(plan, observation)

    def stale_space(
        self, plan: ReachPlan, observation: Observation, newcomers: npt.NDArray[np.float64]
    ) -> StaleSpace:
        """Returns space that the arm passes soon and that was not seen lately; see `Planner`."""
        return self.planner.stale_space(plan, observation, newcomers)

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
