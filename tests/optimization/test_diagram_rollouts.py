import pickle

import numpy as np
import pytest

from pepper_drake.diagrams.factory import make_primitive
from pepper_drake.models.scene import load_scene
from pepper_drake.optimization import CostWeights, make_task, smooth_bumps
from pepper_drake.optimization.diagram_rollouts import DiagramRollouts, outcome_of
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.scenario import Scenario


@pytest.fixture(scope="module")
def evaluate():
    scene = load_scene("table")
    primitive = make_primitive(None, scene.arm)
    parameters = smooth_bumps(primitive, 2, end_state=False)
    cost = CostWeights(hand_to_goal=1.0, arm_to_obstacles=2.0, deviation=0.1)
    return DiagramRollouts(parameters, make_task(primitive), cost, Scenario(seed=3, scene=scene))


def test_the_report_becomes_a_cost(evaluate, monkeypatch):
    # A way through the table: the planner finds out at once and the arm does not start.
    x = np.zeros((1, 6))
    x[0, 2] = -0.6
    travelled = pickle.loads(pickle.dumps(evaluate))
    result = travelled.reach(x[0])
    assert result.report.outcome == "failed"
    log, outcome = result.log, outcome_of(result)
    assert not np.isin(log.mode, (ReachMode.REACHING, ReachMode.HOLDING)).any()
    assert outcome.positions.shape == (1, len(log.time_s), 3)
    error = log.goal_distance_m[-1]
    assert error > 0.2
    assert outcome.end_errors == pytest.approx([error])
    costs = evaluate.cost(outcome, evaluate.task).sum(axis=1)
    lacking = np.maximum(0.0, 0.02 - log.clearance_m)
    assert costs[0] > error + 2.0 * (lacking.max() + lacking.mean())
    monkeypatch.setattr(DiagramRollouts, "reach", lambda self, parameters: result)
    assert evaluate(np.concatenate((x, x))).tolist() == [costs[0], costs[0]]
    assert evaluate.measure(x[0]) == {}
    assert evaluate.primitive_at(x[0]).goal == pytest.approx(evaluate.parameters.primitive.goal)
