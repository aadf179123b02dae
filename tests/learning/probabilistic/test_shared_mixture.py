import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.probabilistic.gaussian_mixture import GaussianMixture
from pepper_drake.learning.probabilistic.shared_mixture import (
    em_step,
    fit_shared_mixtures,
    joint_density,
)


def test_joint_density_worked_by_hand():
    # One component, standard normal in time and value, slope 0. Two demonstrations at s = 0 with
    # values 1 and 2 in frame one, 0 and 0 in frame two: time counts twice, values four times.
    mixture = GaussianMixture(np.array([0.5]), np.zeros((1, 2)), np.eye(2)[None])
    views = [np.array([[0.0, 1.0], [0.0, 2.0]]), np.zeros((2, 2))]
    expected = np.log(0.5) - 6 * 0.5 * np.log(2 * np.pi) - 0.5 * (1 + 4)
    np.testing.assert_allclose(joint_density([mixture, mixture], views, 2), [[expected]])


@settings(max_examples=15)
@given(seed=st.integers(0, 1000), num_frames=st.integers(1, 3), num_components=st.integers(1, 5))
def test_likelihood_never_falls(seed, num_frames, num_components):
    rng = np.random.default_rng(seed)
    clock = np.tile(np.linspace(-1, 1, 40), 3)
    views = [np.column_stack((clock, rng.standard_normal((120, 2)))) for _ in range(num_frames)]
    mixtures = fit_shared_mixtures(views, 3, num_components, max_iterations=1)
    before = -np.inf
    for _ in range(12):
        log_joint = joint_density(mixtures, views, 3)
        after = np.logaddexp.reduce(log_joint, axis=1).mean()
        assert after >= before - 1e-9
        before = after
        mixtures = em_step(mixtures, views, log_joint, 1e-9)


def test_two_ways_around_have_their_middle_as_mean():
    # One demonstration goes left, one right: no moment has a component of its own for each.
    s = np.linspace(0, 1, 60)
    bulge = np.sin(np.pi * s)
    view = np.column_stack((np.tile(s, 2), np.concatenate((bulge, -bulge))))
    (mixture,) = fit_shared_mixtures([view / view.std(axis=0)], 2, 20)
    regression = mixture.regress(s[:, None] / view[:, 0].std())
    np.testing.assert_allclose(regression.means, 0, atol=1e-6)
    deviation = view[:, 1].std() * np.sqrt(regression.covariances[:, 0, 0])
    np.testing.assert_allclose(deviation, bulge, atol=0.09)


def test_one_primitive_from_several_demonstrations_knows_their_spread():
    rng = np.random.default_rng(0)
    s = np.linspace(0, 1, 200)
    demonstrations = []
    for _ in range(6):
        height = 0.1 + 0.02 * rng.standard_normal()
        positions = np.column_stack((0.3 * s, height * np.sin(np.pi * s) ** 2, 0.1 * s**2))
        demonstrations.append(Demonstration.from_positions(2 * s, positions))
    primitive = MovementPrimitive.fit(demonstrations, approximator="gmr", num_basis=25)
    path = primitive.rollout()
    mean = np.mean([d.positions[::2] for d in demonstrations], axis=0)
    middle = path.positions[100]
    np.testing.assert_allclose(middle, [0.15, mean[50, 1], 0.025], atol=2e-3)
    covariances = primitive.translation.model.covariances(primitive.phase_at([0.1, 1.0]))
    spread = np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    assert spread[1, 1] > 10 * spread[1, 0]
    assert spread[1, 1] > 10 * spread[1, 2]


def test_more_components_than_moments_is_refused():
    with pytest.raises(InputError, match="choose 1 to 3"):
        fit_shared_mixtures([np.zeros((6, 2))], 2, 4)
