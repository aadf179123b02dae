import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.optimization import Problem, make_optimizer
from pepper_drake.optimization.power import Power, policy_step
from tests.optimization.conftest import bowl


def test_equation_d_6_is_a_weighted_regression_of_the_actions():
    random = np.random.default_rng(0)
    features, theta = random.standard_normal((7, 3)), random.standard_normal((3, 2))
    explored, returns = random.standard_normal((4, 3, 2)), random.random((4, 7))
    variances = random.random((3, 2)) + 0.1
    step = policy_step(explored.reshape(4, 6), returns, features, variances.ravel())
    for k in range(2):
        # All actions of all rollouts below one another, each equation times the root of Q / v.
        actions = np.concatenate([features @ (theta + e)[:, k] for e in explored])
        root = np.sqrt(returns / (features**2 @ variances[:, k])).ravel()
        stacked = np.tile(features, (4, 1)) * root[:, None]
        wanted = np.linalg.lstsq(stacked, actions * root)[0]
        assert theta[:, k] + step.reshape(3, 2)[:, k] == pytest.approx(wanted)


def test_without_steps_it_is_the_average_weighted_with_the_returns():
    explored, returns = np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([[3.0], [1.0]])
    assert policy_step(explored, returns, None, np.ones(2)).tolist() == [0.75, 0.25]


def test_a_step_that_no_feature_acts_at_changes_nothing():
    # The second parameter acts in the second half only, where the first rollout did well.
    features = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]])
    returns = np.array([[1e-9, 1e-9, 1.0, 1.0], [1.0, 1.0, 1e-9, 1e-9]])
    explored = np.array([[5.0, 2.0], [-1.0, 7.0]])
    assert policy_step(explored, returns, features, np.ones(2)) == pytest.approx([-1.0, 2.0])


def regulator(steps=30, start=1.0):
    """x' = x + u, u = -theta x; cost x² + u² of each step: the best gain is the golden ratio's."""

    def evaluate(samples):
        x, costs = np.full(len(samples), start), []
        for _ in range(steps):
            u = -samples[:, 0] * x
            costs.append(x**2 + u**2)
            x = x + u
        return np.stack(costs, axis=1)

    return Problem(np.array([0.1]), 0.2, evaluate, chunk=1000)


BEST_GAIN = (np.sqrt(5.0) - 1.0) / 2.0  # Of the Riccati equation p = 1 + p - p² / (1 + p).


@pytest.mark.parametrize(
    ("method", "settings"), [("power", {}), ("enac", {"step": 1.0, "decay": 0.9})]
)
def test_policy_search_solves_a_linear_quadratic_problem(method, settings):
    problem = regulator()
    search = make_optimizer(method, problem, samples=20, seed=1, **settings)
    for _ in range(40):
        search.tell(problem.evaluate(search.ask()))
    assert search.mean[0] == pytest.approx(BEST_GAIN, abs=0.02)


def test_the_best_rollouts_of_all_updates_are_kept():
    search = Power(bowl([0.0, 0.0]), samples=3, kept=2, seed=0)
    first = search.ask()
    search.tell(np.array([1.0, 5.0, 2.0]))
    search.ask()
    search.tell(np.array([7.0, 8.0, 9.0]))
    # Nothing new was better: the two of the first update, 1 against exp(-10).
    weight = np.exp(-10.0)
    wanted = (first[0] + weight * first[2]) / (1.0 + weight)
    assert search.mean == pytest.approx(wanted)


def test_exploration_is_learned_where_it_matters_first_and_within_a_band():
    problem = bowl([0.0, 3.0], curvatures=np.array([100.0, 0.01]), exploration=1.0)
    search = Power(problem, samples=20, seed=2, band=10.0)
    ratios = []
    for _ in range(60):
        search.tell(problem.evaluate(search.ask()))
        ratios.append(search.deviations[0] / search.deviations[1])
        assert np.all((search.deviations >= 0.1 - 1e-12) & (search.deviations <= 1.0))
    assert ratios[0] < 0.5
    assert search.converged
    assert abs(search.mean[0]) < 0.1


@pytest.mark.parametrize(
    ("settings", "words"),
    [({"kept": 0}, "kept: 0 rollouts"), ({"band": 0.5}, "band: 0.5 is not 1 or more")],
)
def test_bad_settings(settings, words):
    with pytest.raises(InputError, match=words):
        Power(bowl([1.0]), **settings)
