"""A planner around another one: what is done with every question stands in one place."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.planning.reach.reach_plan import Planner, ReachPlan, RemainingClearance
from pepper_drake.planning.reach.separation import StaleSpace

T = TypeVar("T")


@dataclass(frozen=True)
class PlannerWrapper:
    """A `Planner` that hands all questions on to another one.

    A subclass overrides `_answer` to change questions or answers.

    Attributes:
        planner: Gives the answers.
    """

    planner: Planner

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
        return self._answer("plan_base_placement", observation, self.planner.plan_base_placement)

    def check_drive(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns a base placement as it looks now; see `Planner`."""
        return self._answer(
            "check_drive", observation, lambda asked: self.planner.check_drive(plan, asked)
        )

    def check_reach(self, observation: Observation, movement: Movement | None = None) -> ReachPlan:
        """Returns the best plan from where the base is; see `Planner`."""
        return self._answer(
            "check_reach", observation, lambda asked: self.planner.check_reach(asked, movement)
        )

    def replan(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns the best plan for the rest of a movement; see `Planner`."""
        return self._answer("replan", observation, lambda asked: self.planner.replan(plan, asked))

    def plan_retreat(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns a plan back to where there is more clearance; see `Planner`."""
        return self._answer(
            "plan_retreat", observation, lambda asked: self.planner.plan_retreat(plan, asked)
        )

    def remaining_clearance(self, plan: ReachPlan, observation: Observation) -> RemainingClearance:
        """Returns distances of the rest of a plan's path to obstacles; see `Planner`."""
        return self._answer(
            "remaining_clearance",
            observation,
            lambda asked: self.planner.remaining_clearance(plan, asked),
        )

    def stale_space(
        self,
        plan: ReachPlan,
        observation: Observation,
        new_obstacle: npt.NDArray[np.float64],
        movable: npt.NDArray[np.float64],
    ) -> StaleSpace:
        """Returns space that the arm passes soon and that was not seen lately; see `Planner`."""
        return self._answer(
            "stale_space",
            observation,
            lambda asked: self.planner.stale_space(plan, asked, new_obstacle, movable),
        )

    def _answer(self, name: str, observation: Observation, ask: Callable[[Observation], T]) -> T:
        """Returns what `ask`, the inner planner's method of this name, says to an observation."""
        return ask(observation)
