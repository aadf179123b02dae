from types import SimpleNamespace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.planning import ReachPlannerParams
from pepper_drake.planning.reach.base_placement_planner import BasePlacementPlanner
from pepper_drake.planning.reach.reach_plan import PlanStatus, ReachPlan

PLACES = 30


class Evaluator:
    """Deforming demonstrations finds no path; the path planner finds one at one base placement."""

    def __init__(self, solved):
        self.params, self.solved = ReachPlannerParams(), solved
        self.planned: list[int] = []
        self.adapter = SimpleNamespace(
            goal_postures=lambda X_TG, checker, allowance: (None, np.array([checker]))
        )
        self.demonstrated = SimpleNamespace(
            X_OG=RigidTransform(), primitive=SimpleNamespace(duration=1.0)
        )

    def scenes(self, number, obstacles):
        """Returns the scene of a base placement; its number is the cost of the goal posture."""
        return SimpleNamespace(X_TO=RigidTransform(), checker=float(number), number=number)

    def evaluate(self, scene, movement, allowance):
        return ReachPlan(PlanStatus.NO_CLEAR_PATH, "too close", np.zeros(3))

    def adapted(self, scene, simulated=None, *, deform=True, plan=True, allowance=0.0):
        assert deform != plan  # Each is tried for itself.
        if plan:
            self.planned.append(scene.number)
            if scene.number == self.solved:
                yield ReachPlan(PlanStatus.CLEAR, "", np.array([scene.number, 0.0, 0.0]))

    def quality(self, plan):
        return plan.status == PlanStatus.CLEAR

    def is_good(self, plan):
        return plan.status == PlanStatus.CLEAR


@pytest.mark.parametrize(
    ("solved", "asked"), [(7, 8), (None, ReachPlannerParams().max_path_planner_placements)]
)
def test_the_path_planner_is_asked_at_one_placement_after_the_other(solved, asked):
    evaluator = Evaluator(solved)
    planner = BasePlacementPlanner(evaluator, None)
    usual = (evaluator.scenes(number, None) for number in range(3))
    wide = (evaluator.scenes(number, None) for number in range(PLACES))
    plans = list(planner._plans(usual, wide))
    assert evaluator.planned == list(range(asked))  # The easiest first, none after the solution.
    found = [plan.base_pose[0] for plan in plans if evaluator.is_good(plan)]
    assert found == ([] if solved is None else [solved])
