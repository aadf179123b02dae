import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.optimization import Problem, RewardWeightedAveraging
from pepper_drake.optimization.averaging import averaged, decay_over
from pepper_drake.optimization.weighting import best, exponential_weights, normalized
from tests.optimization.conftest import bowl


def test_one_update_of_equation_3_1_worked_by_hand():
    samples = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0], [4.0, 4.0]])
    costs = np.array([3.0, 1.0, 2.0, 5.0])
    # Normalised, h = 4: (1 - c) / (5 - 1) * 4 = -2, 0, -1, -4; the three best are 1, 2 and 0.
    w = {0: np.exp(-2.0), 1: 1.0, 2: np.exp(-1.0)}
    total = w[0] + w[1] + w[2]
    wanted = [w[1] * 1.0 / total, w[2] * 2.0 / total]
    assert averaged(samples, costs, elite=3, eliteness=4.0) == pytest.approx(wanted)


def test_normalised_costs_count_down_from_the_best():
    assert normalized(np.array([2.0, 4.0, 3.0])).tolist() == [0.0, -1.0, -0.5]
    assert normalized(np.array([7.0, 7.0])).tolist() == [0.0, 0.0]
    assert exponential_weights(np.array([1.0, 1.0])).tolist() == [0.5, 0.5]
    assert best(np.array([2.0, 1.0, 1.0, 0.5]), 3).tolist() == [3, 1, 2]


@given(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3), st.integers(0, 20))
def test_neither_a_shift_nor_a_scale_of_the_costs_matters(shift, scale, seed):
    costs = np.random.default_rng(seed).random(8)
    changed = exponential_weights(shift + scale * costs)
    assert changed == pytest.approx(exponential_weights(costs), abs=1e-6)


def test_the_exploration_is_r_times_the_identity_and_decays_with_d_squared():
    problem = Problem(np.zeros(20_000), 0.3, lambda x: x[:, 0])
    search = RewardWeightedAveraging(problem, samples=4, seed=1, rate=0.25, decay=0.8)
    assert search.variance == 0.25
    assert np.std(search.ask() - search.mean, axis=1) == pytest.approx([0.5] * 4, rel=0.02)
    search.tell(np.arange(4.0))
    search.tell(np.arange(4.0))
    assert search.variance == pytest.approx(0.25 * 0.8**4)
    assert np.std(search.ask() - search.mean, axis=1) == pytest.approx([0.32] * 4, rel=0.02)


def test_the_problem_says_how_far_to_explore_where_nobody_else_does():
    assert RewardWeightedAveraging(bowl([1.0], exploration=0.3)).variance == pytest.approx(0.09)


def test_asking_twice_is_asking_once_and_updates_differ():
    search = RewardWeightedAveraging(bowl([1.0, 2.0]))
    first = search.ask()
    assert np.array_equal(first, search.ask())
    search.tell(np.arange(10.0))
    assert not np.allclose(search.ask() - search.mean, first)


def test_it_has_converged_when_the_covariance_no_longer_changes():
    search = RewardWeightedAveraging(bowl([1.0]), decay=0.1, threshold=1e-3)
    changes = []
    while not search.converged:
        before = search.variance
        search.tell(np.arange(10.0))
        changes.append((before - search.variance) / 0.25)
    assert changes[-1] < 1e-3 <= changes[-2]


def test_it_finds_the_bottom_of_a_bowl():
    problem = bowl([0.6, -0.4, 0.2])
    search = RewardWeightedAveraging(problem, samples=20, decay=0.85, seed=3)
    for _ in range(30):
        search.tell(problem.evaluate(search.ask()))
    assert np.abs(search.mean - [0.6, -0.4, 0.2]).max() < 0.01


def test_costs_of_steps_count_as_their_sum():
    one, other = (RewardWeightedAveraging(bowl([1.0, 0.0])) for _ in range(2))
    costs = np.random.default_rng(0).random((10, 6))
    one.tell(costs)
    other.tell(costs.sum(axis=1))
    assert np.array_equal(one.mean, other.mean)


def test_the_decay_over_some_updates_leaves_three_hundredths():
    assert decay_over(7) ** 7 == pytest.approx(0.03)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"samples": 1}, "samples: 1 in each update"),
        ({"rate": -1.0}, "rate: -1.0 is not a positive number"),
        ({"decay": 1.5}, "decay: 1.5 is not above 0"),
        ({"elite": 11}, "elite: 11 of 10 samples"),
        ({"eliteness": 0.0}, "eliteness: 0.0"),
    ],
)
def test_bad_settings(settings, words):
    with pytest.raises(InputError, match=words):
        RewardWeightedAveraging(bowl([1.0]), **settings)
