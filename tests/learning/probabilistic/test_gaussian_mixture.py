import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.learning.probabilistic.gaussian_mixture import (
    GaussianMixture,
    fit_gaussian_mixture,
    initial_mixture,
    maximisation,
)


def blobs(seed=0, count=300):
    """Three well separated clouds in the plane, the second twice as dense."""
    rng = np.random.default_rng(seed)
    centres = np.array([[0.0, 0.0], [5.0, 1.0], [1.0, 6.0]])
    labels = rng.choice(3, size=count, p=[0.25, 0.5, 0.25])
    return centres[labels] + 0.3 * rng.standard_normal((count, 2))


def test_density_of_a_mixture_worked_by_hand():
    # N(0; 0, 4) = 1 / sqrt(8 pi); N(0; 1, 1) = exp(-1/2) / sqrt(2 pi).
    mixture = GaussianMixture(
        np.array([0.25, 0.75]), np.array([[0.0], [1.0]]), np.array([[[4.0]], [[1.0]]])
    )
    first = 0.25 / np.sqrt(8 * np.pi)
    second = 0.75 * np.exp(-0.5) / np.sqrt(2 * np.pi)
    np.testing.assert_allclose(mixture.log_joint(np.zeros((1, 1))), np.log([[first, second]]))
    assert mixture.log_likelihood(np.zeros((1, 1))) == pytest.approx(np.log(first + second))
    np.testing.assert_allclose(
        mixture.responsibilities(np.zeros((1, 1))),
        [[first / (first + second), 1 - first / (first + second)]],
    )


def test_maximisation_worked_by_hand():
    # Component 0 takes points 0 and 2 whole and half of 6: mean (0 + 2 + 3) / 2.5 = 2, variance
    # (4 + 0 + 0.5 * 16) / 2.5 = 4.8. Component 1 has the other half of 6 and nothing else.
    data = np.array([[0.0], [2.0], [6.0]])
    responsibilities = np.array([[1.0, 0.0], [1.0, 0.0], [0.5, 0.5]])
    previous = GaussianMixture(np.full(2, 0.5), np.zeros((2, 1)), np.ones((2, 1, 1)))
    mixture = maximisation(data, responsibilities, 0.01, previous)
    np.testing.assert_allclose(mixture.priors, [2.5 / 3, 0.5 / 3])
    np.testing.assert_allclose(mixture.means, [[2.0], [6.0]])
    np.testing.assert_allclose(mixture.covariances.ravel(), [4.8, 0.01])


def test_a_component_without_data_keeps_what_it_had():
    previous = GaussianMixture(
        np.array([0.5, 0.5]), np.array([[0.0], [9.0]]), np.array([[[1.0]], [[7.0]]])
    )
    mixture = maximisation(np.array([[1.0], [3.0]]), np.array([[1.0, 0.0]] * 2), 1e-6, previous)
    assert mixture.priors[1] == 0
    assert mixture.means[1, 0] == 9
    assert mixture.covariances[1, 0, 0] == 7
    assert np.isfinite(mixture.log_likelihood(np.array([[2.0]])))


@settings(max_examples=25)
@given(
    seed=st.integers(0, 10_000),
    num_components=st.integers(1, 6),
    floor=st.sampled_from([1e-6, 1e-3, 0.3]),
    duplicates=st.integers(0, 20),
)
def test_likelihood_never_falls(seed, num_components, floor, duplicates):
    rng = np.random.default_rng(seed)
    data = rng.standard_normal((40, 3)) * rng.uniform(0.2, 3, 3)
    data[:duplicates] = data[0]  # A degenerate cloud, where only the floor keeps a variance.
    mixture = initial_mixture(data, num_components, floor, rng=rng)
    before = mixture.log_likelihood(data)
    for _ in range(15):
        mixture = maximisation(data, mixture.responsibilities(data), floor, mixture)
        after = mixture.log_likelihood(data)
        assert after >= before - 1e-9 * (1 + abs(before))
        assert np.linalg.eigvalsh(mixture.covariances).min() >= floor * (1 - 1e-6)
        before = after


def test_recovers_the_clouds_it_was_given():
    mixture = fit_gaussian_mixture(blobs(count=2000), 3)
    order = np.argsort(mixture.means @ [1.0, 0.1])
    np.testing.assert_allclose(mixture.means[order], [[0, 0], [1, 6], [5, 1]], atol=0.05)
    np.testing.assert_allclose(mixture.priors[order], [0.25, 0.25, 0.5], atol=0.04)
    np.testing.assert_allclose(mixture.covariances, np.tile(0.09 * np.eye(2), (3, 1, 1)), atol=0.01)


@settings(max_examples=10)
@given(scale=st.floats(1e-3, 1e3), shift=st.floats(-100, 100))
def test_units_do_not_matter(scale, shift):
    data = blobs()
    plain = fit_gaussian_mixture(data, 3)
    other = fit_gaussian_mixture(data * [1.0, scale] + [0.0, shift], 3)
    np.testing.assert_allclose(other.means[:, 0], plain.means[:, 0], atol=1e-6)
    np.testing.assert_allclose((other.means[:, 1] - shift) / scale, plain.means[:, 1], atol=1e-6)


def test_regression_with_one_component_is_gaussian_conditioning():
    mixture = GaussianMixture(
        np.ones(1), np.array([[1.0, 2.0]]), np.array([[[4.0, 2.0], [2.0, 5.0]]])
    )
    regression = mixture.regress(np.array([[3.0]]))
    np.testing.assert_allclose(regression.means, [[2 + 2 / 4 * (3 - 1)]])
    np.testing.assert_allclose(regression.covariances, [[[5 - 2 * 2 / 4]]])


def test_regression_covariances_worked_by_hand():
    # At input 0 two components of equal weight say 1 +- 2 and 5 +- 1 (standard deviations).
    mixture = GaussianMixture(
        np.full(2, 0.5),
        np.array([[0.0, 1.0], [0.0, 5.0]]),
        np.array([np.diag([1.0, 4.0]), np.diag([1.0, 1.0])]),
    )
    at_zero = np.zeros((1, 1))
    np.testing.assert_allclose(mixture.regress(at_zero).means, [[3.0]])
    # Within: (4 + 1) / 2; between: the means are 2 from their middle.
    np.testing.assert_allclose(mixture.regress(at_zero).covariances, [[[2.5 + 4.0]]])
    np.testing.assert_allclose(mixture.regress(at_zero, "report").covariances, [[[5.0 / 4]]])


def test_posterior_covariance_agrees_with_samples():
    mixture = fit_gaussian_mixture(blobs(count=600), 4, seed=1)
    samples = mixture.sample(400_000, np.random.default_rng(0))
    near = samples[np.abs(samples[:, 0] - 0.9) < 0.05, 1]
    regression = mixture.regress(np.array([[0.9]]))
    assert regression.means[0, 0] == pytest.approx(near.mean(), abs=0.1)
    assert regression.covariances[0, 0, 0] == pytest.approx(near.var(), rel=0.05)


def test_transformed_mixture_moves_with_its_data():
    mixture = fit_gaussian_mixture(blobs(), 3)
    matrix, offset = np.array([[0.0, -2.0], [1.0, 0.5]]), np.array([3.0, -1.0])
    data = blobs(seed=5)
    moved = mixture.transformed(matrix, offset)
    np.testing.assert_allclose(
        moved.log_joint(data @ matrix.T + offset),
        mixture.log_joint(data) - np.log(abs(np.linalg.det(matrix))),
    )


def test_agrees_with_scikit_learn():
    mixture_module = pytest.importorskip("sklearn.mixture")
    data = np.random.default_rng(3).standard_normal((400, 3)) + blobs(count=400)[:, [0, 1, 0]]
    scaled = (data - data.mean(axis=0)) / data.std(axis=0)
    start = scaled[[10, 100, 200]]
    ours = initial_mixture(scaled, 3, 1e-9, initial_means=start, rng=np.random.default_rng(0))
    theirs = mixture_module.GaussianMixture(
        3,
        reg_covar=1e-9,
        tol=0,
        max_iter=50,
        weights_init=ours.priors,
        means_init=ours.means,
        precisions_init=np.linalg.inv(ours.covariances),
    )
    with pytest.warns(match="did not converge"):
        theirs.fit(scaled)
    for _ in range(50):
        ours = maximisation(scaled, ours.responsibilities(scaled), 1e-9, ours)
    np.testing.assert_allclose(ours.means, theirs.means_, atol=1e-6)
    np.testing.assert_allclose(ours.covariances, theirs.covariances_, atol=1e-6)
    assert ours.log_likelihood(data) == pytest.approx(theirs.score(data), rel=1e-6)


def test_more_components_than_samples_is_refused():
    with pytest.raises(InputError, match="num_components is 4"):
        fit_gaussian_mixture(np.zeros((3, 2)), 4)
