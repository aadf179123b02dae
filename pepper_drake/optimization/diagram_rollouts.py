"""Rollouts in the full diagram: dynamics, cameras, noise and all; seconds each."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pepper_drake.diagrams.reach_result import ReachResult
from pepper_drake.diagrams.reach_simulation import ReachSimulation, RunOptions
from pepper_drake.learning import MovementPrimitive
from pepper_drake.optimization.cost import Cost
from pepper_drake.optimization.cost_terms import Task
from pepper_drake.optimization.outcome import Outcome
from pepper_drake.optimization.parameters import MovementParameters
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.scenario import Scenario, build_reaching

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DiagramRollouts:
    """Costs of parameters, by simulating Pepper's reach in a scene.

    All reaches have the same noise, so that costs differ by the parameters alone. If the robot
    refuses to start, the cost is that of the hand far from the goal.

    Attributes:
        parameters: Meaning of the numbers.
        task: Of the movement; the goal is the scene's.
        cost: Of an outcome.
        scenario: Scene and settings of the reach, except for the movement.
    """

    parameters: MovementParameters
    task: Task
    cost: Cost
    scenario: Scenario

    def __call__(self, samples: Array) -> Array:
        """Returns the costs (S,) of parameters (S, n), one after the other."""
        return np.array(
            [np.sum(self.cost(self.outcome(sample[None]), self.task)) for sample in samples]
        )

    def outcome(self, samples: Array) -> Outcome:
        """Returns the outcome of parameters (1, n)."""
        return outcome_of(self.reach(samples[0]))

    def primitive_at(self, parameters: Array) -> MovementPrimitive:
        """Returns the primitive with parameters (n,)."""
        return self.parameters.primitive_at(parameters)

    def measure(self, parameters: Array) -> dict[str, float]:
        """Returns no measurements: they would take another reach."""
        return {}

    def reach(self, parameters: Array) -> ReachResult:
        """Simulates a reach with parameters (n,)."""
        # Evaluates this movement, not the planner's adaptation of it.
        planner = replace(self.scenario.planner, adapt=False)
        scenario = replace(self.scenario, planner=planner)
        reaching = build_reaching(scenario, primitive=self.primitive_at(parameters))
        return ReachSimulation(reaching, RunOptions(progress=False)).run()


def outcome_of(result: ReachResult) -> Outcome:
    """Returns a reach as an outcome of one movement.

    Its steps are those while the arm reached, or all if it never started. The gaps are the true
    distances of Pepper's whole body to the obstacles; the end error is to the true goal.
    """
    log = result.log
    moving = np.isin(log.mode, (ReachMode.REACHING, ReachMode.HOLDING, ReachMode.DONE))
    if np.count_nonzero(moving) < 3:
        moving = np.ones(len(log.mode), dtype=bool)
    times = log.time_s[moving] - log.time_s[moving][0]
    return Outcome(
        times,
        log.hand_position_torso_m[moving][None],
        end_errors=log.goal_distance_m[-1:],
        arm_distances=lambda: log.clearance_m[moving][None],
    )
