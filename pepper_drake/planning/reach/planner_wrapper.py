"""A planner that forwards all requests to another one, and can intercept them in one place."""

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
    """Forwards all requests to another `Planner`.

    A subclass overrides `_answer` to change requests or answers.

    Attributes:
        planner: The inner planner.
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
        """Returns the best plan over all base placements; see `Planner`."""
        return self._answer("plan_base_placement", observation, self.planner.plan_base_placement)

    def look_along_drive(self, observation: Observation) -> npt.NDArray[np.float64]:
        """Returns where to look before the base placement is known; see `Planner`."""
        return self._answer("look_along_drive", observation, self.planner.look_along_drive)

    def check_drive(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns a base placement, checked again; see `Planner`."""
        return self._answer(
            "check_drive", observation, lambda asked: self.planner.check_drive(plan, asked)
        )

    def check_reach(self, observation: Observation, movement: Movement | None = None) -> ReachPlan:
        """Returns the best plan from the present base pose; see `Planner`."""
        return self._answer(
            "check_reach", observation, lambda asked: self.planner.check_reach(asked, movement)
        )

    def replan(self, plan: ReachPlan, observation: Observation) -> ReachPlan:
        """Returns the best plan for the rest of a movement; see `Planner`."""
        return self._answer("replan", observation, lambda asked: self.planner.replan(plan, asked))

    def plan_retreat(
        self, travelled: npt.NDArray[np.float64], observation: Observation
    ) -> ReachPlan:
        """Returns a plan back to a configuration with more clearance; see `Planner`."""
        return self._answer(
            "plan_retreat", observation, lambda asked: self.planner.plan_retreat(travelled, asked)
        )

    def plan_return(
        self,
        travelled: npt.NDArray[np.float64],
        posture: npt.NDArray[np.float64],
        observation: Observation,
    ) -> ReachPlan:
        """Returns a plan back to a posture; see `Planner`."""
        return self._answer(
            "plan_return",
            observation,
            lambda asked: self.planner.plan_return(travelled, posture, asked),
        )

    def remaining_clearance(self, plan: ReachPlan, observation: Observation) -> RemainingClearance:
        """Returns the clearance along the rest of a plan's path; see `Planner`."""
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
        """Returns space that the arm sweeps soon and that was not seen recently; see `Planner`."""
        return self._answer(
            "stale_space",
            observation,
            lambda asked: self.planner.stale_space(plan, asked, new_obstacle, movable),
        )

    def _answer(self, name: str, observation: Observation, ask: Callable[[Observation], T]) -> T:
        """Returns the answer of `ask`, the inner planner's method `name`, to an observation."""
        return ask(observation)
