"""Measures how long a planner computes, for reports; nothing that is planned depends on it."""

from collections.abc import Callable
from dataclasses import dataclass, field
from time import thread_time
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.planning.reach.reach_plan import Planner, ReachPlan, RemainingClearance
from pepper_drake.planning.reach.separation import StaleSpace

T = TypeVar("T")


class PlanningTime(NamedTuple):
    """Computing time of one call.

    Attributes:
        name: Of the planner's method.
        time: Of the observation, in simulation [s].
        seconds: Of a processor of this computer, whatever else it does [s].
    """

    name: str
    time: float
    seconds: float


@dataclass(frozen=True)
class TimedPlanner:
    """A `Planner` that hands all questions on and keeps what the answers took of a processor.

    Attributes:
        planner: Gives the answers.
        log: Computing times in the order of the calls, of all simulations that use this planner.
    """

    planner: Planner
    log: list[PlanningTime] = field(default_factory=list)

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
        return self._timed(
            "plan_base_placement",
            observation,
            lambda: self.planner.plan_base_placement(observation),
        )

    def check_reach(self, observation: Observation, movement: Movement | None = None) -> ReachPlan:
        """Returns the best plan from where the base is; see `Planner`."""
        return self._timed(
            "check_reach", observation, lambda: self.planner.check_reach(observation, movement)
        )

    def replan(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns the best plan for the rest of a movement; see `Planner`."""
        return self._timed("replan", observation, lambda: self.planner.replan(plan, observation))

    def plan_retreat(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns a plan back to where there is more clearance; see `Planner`."""
        return self._timed(
            "plan_retreat", observation, lambda: self.planner.plan_retreat(plan, observation)
        )

    def remaining_clearance(self, plan: ReachPlan, observation: Observation) -> RemainingClearance:
        """Returns distances of the rest of a plan's path to obstacles; see `Planner`."""
        return self._timed(
            "remaining_clearance",
            observation,
            lambda: self.planner.remaining_clearance(plan, observation),
        )

    def stale_space(
        self, plan: ReachPlan, observation: Observation, newcomers: npt.NDArray[np.float64]
    ) -> StaleSpace:
        """Returns space that the arm passes soon and that was not seen lately; see `Planner`."""
        return self._timed(
            "stale_space",
            observation,
            lambda: self.planner.stale_space(plan, observation, newcomers),
        )

    def seconds(self, first: float, last: float) -> float:
        """Returns the computing time for observations from one time to another [s]."""
        return sum(one.seconds for one in self.log if first <= one.time <= last)

    def _timed(self, name: str, observation: Observation, call: Callable[[], T]) -> T:
        begin = thread_time()
        answer = call()
        self.log.append(PlanningTime(name, observation.time, thread_time() - begin))
        return answer
