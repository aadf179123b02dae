import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.optimization.natural_actor_critic import (
    EpisodicNaturalActorCritic,
    natural_gradient,
)
from tests.optimization.conftest import bowl


def test_the_natural_gradient_of_a_linear_return_is_sigma_times_the_gradient():
    deviations, gradient = np.array([0.5, 2.0, 1.0]), np.array([3.0, -1.0, 0.5])
    explored = deviations * np.random.default_rng(0).standard_normal((9, 3))
    found = natural_gradient(explored, 7.0 + explored @ gradient, deviations)
    assert found == pytest.approx(deviations**2 * gradient)  # G^-1 grad J, G = Sigma^-1.


def test_the_natural_gradient_of_a_quadratic_return_is_right_on_average():
    # J(theta) = -E |theta + eps - a|²_A, so its gradient is -2 A (theta - a).
    deviations, curvatures = np.array([0.3, 0.6]), np.array([1.0, 5.0])
    away = np.array([1.0, -0.5])  # theta - a
    explored = deviations * np.random.default_rng(1).standard_normal((20000, 2))
    returns = -np.sum(curvatures * (away + explored) ** 2, axis=1)
    wanted = deviations**2 * (-2 * curvatures * away)
    assert natural_gradient(explored, returns, deviations) == pytest.approx(wanted, rel=0.03)


def test_with_few_rollouts_what_was_not_tried_is_left_alone():
    deviations = np.array([1.0, 0.1, 1.0, 1.0])
    explored = np.array([[1.0, 0.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.2, 0.0, 0.0]])
    found = natural_gradient(explored, np.array([2.0, 0.0, 1.0]), deviations)
    assert found[2:].tolist() == [0.0, 0.0]
    assert found[0] == pytest.approx(1.0)
    assert found[1] == pytest.approx(0.0, abs=1e-12)


def test_a_bandit_is_solved():
    problem = bowl([0.7, -0.2], curvatures=np.array([1.0, 10.0]))
    search = EpisodicNaturalActorCritic(problem, samples=12, step=1.0, decay=0.9, seed=4)
    for _ in range(50):
        search.tell(problem.evaluate(search.ask()))
    assert search.mean == pytest.approx([0.7, -0.2], abs=0.02)


def test_the_unit_of_the_cost_makes_no_difference():
    one, other = (EpisodicNaturalActorCritic(bowl([1.0, 2.0])) for _ in range(2))
    costs = np.random.default_rng(0).random(10)
    one.tell(costs)
    other.tell(500.0 + 1000.0 * costs)
    assert one.mean == pytest.approx(other.mean)
    assert np.linalg.norm(one.mean / 0.5) == pytest.approx(4.0)


def test_equal_costs_lead_nowhere_and_it_converges():
    search = EpisodicNaturalActorCritic(bowl([1.0]), decay=0.1, threshold=1e-3)
    assert not search.converged
    for _ in range(5):
        search.tell(np.ones(10))
    assert search.mean.tolist() == [0.0]
    assert search.converged


def test_bad_settings():
    with pytest.raises(InputError, match=r"step: 0.0 is not a positive number"):
        EpisodicNaturalActorCritic(bowl([1.0]), step=0.0)
