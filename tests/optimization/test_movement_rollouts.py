import json

import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.optimization import CostWeights, History, make_task
from pepper_drake.optimization.movement_rollouts import make_parameters, make_rollouts
from pepper_drake.reporting.optimization_report import save_search


def test_what_is_searched(primitive):
    assert make_parameters(primitive, "hand", None, end_state=True).size == 75
    assert make_parameters(primitive, "hand", 4, end_state=False).size == 12
    with pytest.raises(InputError, match="free: 'legs' is unknown; use one of hand, joints, arm"):
        make_parameters(primitive, "legs", None, end_state=True)
    for free in ("joints", "arm"):
        with pytest.raises(InputError, match="it has no joints"):
            make_parameters(primitive, free, None, end_state=True)


def test_how_it_is_tried(primitive):
    parameters = make_parameters(primitive, "hand", 2, end_state=True)
    task, cost = make_task(primitive), CostWeights(hand_to_goal=1.0)
    assert make_rollouts("fast", parameters, task, cost)(np.zeros((3, 9))).shape[0] == 3
    with pytest.raises(InputError, match="rollouts: 'slow' is unknown; use one of fast"):
        make_rollouts("slow", parameters, task, cost)
    with pytest.raises(InputError, match="diagram needs a scenario"):
        make_rollouts("diagram", parameters, task, cost)
    with pytest.raises(InputError, match="it has no joints of an arm"):
        make_rollouts("kinematics", parameters, task, cost)


def test_a_search_that_has_hardly_begun_leaves_a_report(primitive, tmp_path):
    parameters = make_parameters(primitive, "hand", 2, end_state=True)
    evaluate = make_rollouts(
        "fast", parameters, make_task(primitive), CostWeights(hand_to_goal=1.0)
    )
    history = History({"method": "power"}, means=[np.full(9, 0.01)], mean_costs=[float("nan")])
    measured = save_search(tmp_path, history, evaluate, seconds=1.0, converged=False)
    assert measured["hand_to_goal"] == pytest.approx(0.01 * np.sqrt(3), rel=0.2)
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["best_cost"] is None
    assert report["costs"] == [None]
    assert not (tmp_path / "cost.png").exists()
    found = MovementPrimitive.load(tmp_path / "primitive.yaml")
    assert found.goal == pytest.approx(primitive.goal + 0.01)
