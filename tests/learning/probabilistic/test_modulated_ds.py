import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning.probabilistic.gaussian_mixture import GaussianMixture
from pepper_drake.learning.probabilistic.modulated_ds import ModulatedSystem, fit_modulated_system


def arc(duration=2.0):
    """A reach at rest at both ends."""
    s = np.linspace(0, 1, 150)
    walked = s**3 * (10 - 15 * s + 6 * s**2)
    positions = np.column_stack((0.3 * walked, 0.1 * np.sin(np.pi * walked), 0.1 * walked))
    return Demonstration.from_positions(duration * s, positions)


@pytest.fixture(scope="module")
def system():
    return fit_modulated_system([arc(1.8), arc(2.0), arc(2.2)])


def test_modulation_solves_its_equation(system):
    step = 1e-4
    t = np.linspace(0.01, 3, 30)
    before, now, after = (system.modulation(t + shift) for shift in (-step, 0, step))
    first, second = (after - before) / (2 * step), (after - 2 * now + before) / step**2
    a = system.alpha_m
    np.testing.assert_allclose(second, a * (-first - a * now / 4), atol=1e-4)
    assert system.modulation(0.0) == 1
    assert system.modulation(system.duration) == pytest.approx(0.3, abs=1e-3)


def test_without_modulation_it_is_the_critically_damped_spring():
    # No learned velocity: with gamma = 1 the hand stands, as gamma falls the spring takes over.
    still = GaussianMixture(np.ones(1), np.zeros((1, 4)), np.eye(4)[None])
    system = ModulatedSystem(still, duration=2.0, alpha=10.0, beta=2.5, alpha_m=1e4)
    path = system.rollout(np.zeros(3), [1.0, 0, 0], time_step=1e-3)
    t = path.times
    np.testing.assert_allclose(path.positions[:, 0], 1 - (1 + 5 * t) * np.exp(-5 * t), atol=2e-3)


def test_follows_the_demonstrated_way_which_the_spring_alone_cuts(system):
    shown = arc().positions
    path = system.rollout(np.zeros(3), shown[-1])
    away = np.linalg.norm(path.positions[:, None] - shown, axis=2).min(axis=1)
    straight = np.outer(np.linspace(0, 1, 50), shown[-1])
    cut = np.linalg.norm(shown[:, None] - straight, axis=2).min(axis=1)
    assert away.max() < 0.35 * cut.max()


@pytest.mark.parametrize("goal", [[0.3, 0.0, 0.1], [0.4, 0.2, 0.0], [-0.1, 0.1, 0.3]])
@pytest.mark.parametrize("start", [[0.0, 0.0, 0.0], [0.1, -0.2, 0.1]])
def test_reaches_any_goal_from_any_start(system, start, goal):
    path = system.rollout(start, goal, settling=3.0)
    np.testing.assert_allclose(path.positions[-1], goal, atol=1e-3)
    np.testing.assert_allclose(path.velocities[-1], 0, atol=5e-3)


def test_follows_a_goal_that_moves(system):
    steps = round((system.duration + 3.0) / 0.01)
    goals = np.linspace([0.3, 0, 0.1], [0.4, 0.1, 0.1], steps + 1)
    goals[250:] = goals[250]
    path = system.rollout(np.zeros(3), goals, settling=3.0)
    np.testing.assert_allclose(path.positions[-1], goals[-1], atol=1e-3)


def test_time_step_does_not_change_the_path(system):
    coarse = system.rollout(np.zeros(3), [0.35, 0, 0], time_step=0.02).positions
    fine = system.rollout(np.zeros(3), [0.35, 0, 0], time_step=0.001).positions
    np.testing.assert_allclose(coarse, fine[::20], atol=1e-5)


def test_nothing_to_learn_from_is_refused():
    with pytest.raises(InputError, match="at least one"):
        fit_modulated_system([])
