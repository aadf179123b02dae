import cma
import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.optimization import CmaEs
from tests.optimization.conftest import bowl


def test_it_is_the_package_with_our_random_numbers():
    problem = bowl([1.0, -2.0, 0.5])
    ours = CmaEs(problem, samples=8, seed=5)
    random = np.random.default_rng(5)
    options = {"popsize": 8, "randn": lambda *n: random.standard_normal(n), "seed": np.nan}
    theirs = cma.CMAEvolutionStrategy(np.zeros(3), 0.5, options | {"verbose": -9})
    for _ in range(10):
        samples = theirs.ask()
        assert np.array_equal(ours.ask(), samples)
        assert np.array_equal(ours.ask(), samples)
        costs = problem.evaluate(np.array(samples))
        theirs.tell(samples, costs.tolist())
        ours.tell(costs)
    assert np.array_equal(ours.mean, theirs.mean)
    assert np.array_equal(ours.deviations, theirs.stds)


def test_it_finds_the_bottom_and_says_so():
    problem = bowl([1.0, -2.0, 0.5], curvatures=np.array([1.0, 100.0, 1e4]))
    search = CmaEs(problem, samples=10, seed=1)
    rounds = 0
    while not search.converged and rounds < 300:
        search.tell(problem.evaluate(search.ask()))
        rounds += 1
    assert rounds < 300
    assert search.mean == pytest.approx([1.0, -2.0, 0.5], abs=1e-4)


def test_bad_settings():
    with pytest.raises(InputError, match="samples: 2 in each update; use at least 3"):
        CmaEs(bowl([1.0]), samples=2)
