import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.probabilistic.promp import ProMP, basis, em_step, fit_promp, observations


def arcs(count=8, seed=0, samples=80):
    """Reaches whose arcs and ends differ."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 1, samples)
    motions = []
    for _ in range(count):
        a, b, c = rng.normal([0.3, 0.1, 0.2], 0.03)
        walked = s + 0.1 * rng.normal() * np.sin(np.pi * s) ** 2
        positions = np.column_stack((a * walked, b * np.sin(np.pi * walked), c * walked**2))
        motions.append(Demonstration.from_positions(s * rng.uniform(1.5, 2.5), positions))
    return motions


@pytest.fixture(scope="module")
def promp():
    return fit_promp(arcs(), num_basis=10)


def test_basis_functions_add_up_to_one_and_their_derivatives_are_derivatives():
    s, step = np.linspace(0.01, 0.99, 23), 1e-6
    np.testing.assert_allclose(basis(s, 9).sum(axis=1), 1)
    for order in (0, 1):
        difference = (basis(s + step, 9, order) - basis(s - step, 9, order)) / (2 * step)
        np.testing.assert_allclose(basis(s, 9, order + 1), difference, atol=1e-5)


def test_conditioning_worked_by_hand():
    # With s far outside, only the last basis function is left: Phi = (0, ..., 1) for each axis,
    # so the via point is one on the last weight of each axis. Weights 2 and 3 of x (variances 1
    # and 4, covariance 1) are scalar Gaussian conditioning: w_3 seen as 5 +- 2 from a mean of 3
    # has the gain 4 / (4 + 4), so w_3 = 4, var 2, and w_2 = 2 + 1 / 8 * 2, var 1 - 1 / 8.
    mean, covariance = np.zeros(12), np.eye(12)
    mean[2:4] = [2.0, 3.0]
    covariance[2:4, 2:4] = [[1.0, 1.0], [1.0, 4.0]]
    promp = ProMP(mean, covariance, 1e-6, duration=1.0)
    np.testing.assert_allclose(basis([30.0], 4), [[0, 0, 0, 1]], atol=1e-12)
    noise = np.diag([4.0, 1e6, 1e6])
    seen = promp.condition(30.0, [5.0, 0.0, 0.0], covariance=noise)
    np.testing.assert_allclose(seen.mean[2:4], [2.25, 4.0])
    np.testing.assert_allclose(seen.covariance[2:4, 2:4], [[0.875, 0.5], [0.5, 2.0]])
    np.testing.assert_allclose(seen.mean[4:], 0, atol=1e-5)


def test_conditioning_is_that_of_the_joint_gaussian(promp):
    # The textbook formula on the joint Gaussian of all weights and the via point.
    time, value, noise = 0.7 * promp.duration, np.array([0.2, 0.1, 0.1]), 1e-4 * np.eye(3)
    rows = np.kron(np.eye(3), basis([0.7], promp.num_basis))
    joint = np.block(
        [
            [promp.covariance, promp.covariance @ rows.T],
            [rows @ promp.covariance, rows @ promp.covariance @ rows.T + noise],
        ]
    )
    cross, seen = joint[:-3, -3:], joint[-3:, -3:]
    mean = promp.mean + cross @ np.linalg.inv(seen) @ (value - rows @ promp.mean)
    covariance = promp.covariance - cross @ np.linalg.inv(seen) @ cross.T
    conditioned = promp.condition(time, value, covariance=noise)
    np.testing.assert_allclose(conditioned.mean, mean, atol=1e-10)
    np.testing.assert_allclose(conditioned.covariance, covariance, atol=1e-10)


@settings(max_examples=20)
@given(
    time=st.floats(0.0, 1.0),
    offset=st.lists(st.floats(-0.03, 0.03), min_size=3, max_size=3),
)
def test_via_points_are_passed(time, offset):
    promp = ProMP(np.zeros(30), 0.01 * np.eye(30), 1e-6, duration=1.0)
    conditioned = promp.condition(time, offset)
    means, covariances = conditioned.path([time])
    np.testing.assert_allclose(means[0], offset, atol=1e-5)
    assert np.sqrt(np.diagonal(covariances[0])).max() < 1.1e-4
    assert np.linalg.eigvalsh(conditioned.covariance).min() > -1e-12


def test_velocities_can_be_asked_for():
    promp = ProMP(np.zeros(30), 0.01 * np.eye(30), 1e-6, duration=2.0)
    promp = promp.condition(0.0, [0.1, 0.0, 0.0]).condition(0.0, [0, 0.2, 0], derivative=1)
    motion = promp.demonstration(time_step=0.002)
    np.testing.assert_allclose(motion.positions[0], [0.1, 0, 0], atol=1e-5)
    np.testing.assert_allclose(motion.velocities[0], [0, 0.2, 0], atol=1e-5)
    slopes = np.gradient(motion.positions, motion.times, axis=0, edge_order=2)
    np.testing.assert_allclose(slopes, motion.velocities, atol=1e-3)


def test_likelihood_never_falls():
    demonstrations = arcs(5)
    promp = fit_promp(demonstrations, num_basis=8, max_iterations=0)
    data = observations(demonstrations, 8)
    before = promp.log_likelihood(demonstrations)
    for _ in range(10):
        promp = em_step(promp, data, np.zeros((24, 24)))
        after = promp.log_likelihood(demonstrations)
        assert after >= before - 1e-8 * abs(before)
        before = after


def test_log_likelihood_is_that_of_the_marginal_gaussian(promp):
    (demo,) = arcs(1, seed=4, samples=12)
    ((rows, targets),) = observations([demo], promp.num_basis)
    marginal = rows @ promp.covariance @ rows.T + promp.noise * np.eye(len(targets))
    deviation = targets - rows @ promp.mean
    expected = -0.5 * (
        deviation @ np.linalg.solve(marginal, deviation)
        + np.linalg.slogdet(2 * np.pi * marginal)[1]
    )
    assert promp.log_likelihood([demo]) == pytest.approx(expected, rel=1e-6)


def test_recovers_the_distribution_that_motions_were_drawn_from():
    rng = np.random.default_rng(2)
    root = 0.02 * rng.standard_normal((18, 18))
    true = ProMP(0.1 * rng.standard_normal(18), root @ root.T, 1e-8, duration=2.0)
    motions = [true.demonstration(w) for w in true.sample(200, rng)]
    learned = fit_promp(motions, num_basis=6)
    error = learned.path([0.5, 1.5])[1] - true.path([0.5, 1.5])[1]
    assert np.abs(error).max() < 0.3 * np.abs(true.path([0.5, 1.5])[1]).max()
    np.testing.assert_allclose(learned.path([0.5])[0], true.path([0.5])[0], atol=0.02)


def test_samples_have_the_mean_and_the_spread_of_the_path(promp):
    weights = promp.sample(3000, np.random.default_rng(0))
    middle = np.array([promp.demonstration(w, time_step=0.5).positions[2] for w in weights])
    means, covariances = promp.path([promp.demonstration(time_step=0.5).times[2]])
    np.testing.assert_allclose(middle.mean(axis=0), means[0], atol=2e-3)
    np.testing.assert_allclose(np.cov(middle.T), covariances[0], atol=1e-4)


def test_a_primitive_learns_the_conditioned_motion(promp):
    goal = [0.33, 0.0, 0.18]
    motion = promp.condition(promp.duration, goal).demonstration()
    path = MovementPrimitive.fit(motion).rollout(time_step=motion.duration / 200)
    np.testing.assert_allclose(motion.positions[-1], goal, atol=2e-3)
    np.testing.assert_allclose(path.positions[-1], motion.positions[-1], atol=1e-5)


def test_bad_input_is_refused(promp):
    with pytest.raises(InputError, match="at least two"):
        fit_promp(arcs(1))
    with pytest.raises(InputError, match="num_basis is 3"):
        fit_promp(arcs(2), num_basis=3)
    with pytest.raises(InputError, match="via point"):
        promp.condition(0.0, [1.0, 2.0])
