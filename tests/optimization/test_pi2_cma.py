import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.optimization import Pi2Cma
from pepper_drake.optimization.pi2_cma import path_integral_weights, weighted_covariance
from tests.optimization.conftest import bowl


def test_weights_of_two_steps_worked_by_hand():
    costs = np.array([[1.0, 0.0], [0.0, 3.0], [2.0, 2.0]])
    # Costs to go: step 1: 1, 3, 4; step 2: 0, 3, 2. Normalised, h = 2; step 1 counts 2, step 2 1.
    first = np.exp([0.0, -2 * 2 / 3, -2.0])
    second = np.exp([0.0, -2.0, -2 * 2 / 3])
    wanted = (2 * first / first.sum() + second / second.sum()) / 3
    assert path_integral_weights(costs, 2.0) == pytest.approx(wanted)


def test_the_covariance_is_about_the_mean_before_the_update():
    samples, weights = np.array([[1.0, 0.0], [0.0, 2.0]]), np.array([0.25, 0.75])
    wanted = [[0.25, 0.0], [0.0, 3.0]]
    assert weighted_covariance(samples, weights, np.zeros(2)).tolist() == wanted


def test_one_update_is_that_of_the_paper_when_it_learns_at_once():
    search = Pi2Cma(bowl([1.0, 0.0]), samples=6, learning_rate=1.0, least=1e-12)
    samples, costs = search.ask(), np.arange(6.0)
    weights = path_integral_weights(costs, 10.0)
    search.tell(costs)
    assert search.mean == pytest.approx(weights @ samples)
    seen = sum(w * np.outer(s, s) for w, s in zip(weights, samples, strict=True))
    assert search.covariance == pytest.approx(seen, abs=1e-9)


def test_samples_have_the_covariance():
    search = Pi2Cma(bowl([1.0, 0.0]), samples=4000, seed=2)
    search.tell(np.arange(4000.0))
    assert np.cov(search.ask().T) == pytest.approx(search.covariance, rel=0.2, abs=0.005)


def test_it_stretches_along_a_valley_and_finds_its_bottom():
    problem = bowl([2.0, 0.1], curvatures=np.array([1.0, 400.0]))
    search = Pi2Cma(problem, samples=20, seed=1)
    stretched = []
    for _ in range(40):
        search.tell(problem.evaluate(search.ask()))
        stretched.append(search.deviations[0] / search.deviations[1])
    assert max(stretched[:10]) > 4.0
    assert np.abs(search.mean - [2.0, 0.1]).max() < 0.05


def test_exploration_never_ends_and_it_converges():
    search = Pi2Cma(bowl([0.0] * 3), samples=4, least=1e-4)
    for _ in range(200):
        search.tell(bowl([0.0] * 3).evaluate(search.ask()))
    assert np.linalg.eigvalsh(search.covariance).min() >= 0.25e-4 * 0.999
    search = Pi2Cma(bowl([0.0]), threshold=1e9)
    assert not search.converged
    search.tell(np.arange(10.0))
    assert search.converged


def test_bad_settings():
    with pytest.raises(InputError, match=r"learning_rate: 0.0 is not above 0"):
        Pi2Cma(bowl([1.0]), learning_rate=0.0)
