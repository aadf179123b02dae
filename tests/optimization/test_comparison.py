import numpy as np
import pytest

from pepper_drake.optimization import compare_methods, make_optimizer, search
from pepper_drake.reporting.optimization_figures import draw_comparison
from tests.optimization.conftest import bowl


def test_methods_side_by_side():
    problem, done = bowl([0.3, 0.1]), []
    methods = {"algorithm3": {"decay": 0.1, "threshold": 0.5}, "power": {}}
    found = compare_methods(
        problem, methods, updates=4, samples=6, seeds=3, progress=lambda: done.append(1)
    )
    assert len(done) == 6
    assert found.rollouts.tolist() == [0, 6, 12, 18, 24]
    assert found.costs["power"].shape == (3, 5)
    # This one converged at once, and keeps its cost.
    assert np.ptp(found.costs["algorithm3"][:, 2:]) >= 0.0
    assert np.array_equal(found.costs["algorithm3"][:, 2], found.costs["algorithm3"][:, 4])
    alone = search(problem, make_optimizer("power", problem, samples=6, seed=2), 4)
    assert found.costs["power"][2].tolist() == alone.mean_costs
    summary = found.summary()["power"]
    assert summary["median"] == pytest.approx(np.median(found.costs["power"][:, -1]))
    assert summary["lower_quartile"] <= summary["median"] <= summary["upper_quartile"]


def test_the_figure_shows_every_method():
    costs = {name: np.random.default_rng(0).random((4, 3)) for name in ("one", "other")}
    axes = draw_comparison(costs, np.array([0.0, 10.0, 20.0]), "title").axes[0]
    assert [line.get_label() for line in axes.lines] == ["one", "other"]
    assert axes.lines[0].get_ydata() == pytest.approx(np.median(costs["one"], axis=0))
