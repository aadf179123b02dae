import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.learning.approximators.gaussian_forcing import GaussianForcing, even_basis
from pepper_drake.learning.approximators.registry import (
    ForcingData,
    ForcingModel,
    LinearForcingModel,
    approximator_names,
    fade_out,
    get_approximator,
)
from pepper_drake.learning.least_squares import RIDGE, ridge_regression, ridge_solver
from pepper_drake.learning.phase import gate, phase_at

ALPHA_X = 25 / 3
OURS = ("trajectory", "trajectory_slopes", "lwr", "lwr_slopes", "rbfn")


def make_data(forcing, count=201, scales=1.0):
    times = np.linspace(0, 1, count)
    phases = phase_at(times, ALPHA_X)
    targets = forcing(times)
    return ForcingData(
        phases=phases,
        times=times,
        targets=targets,
        responses=np.zeros_like(targets),
        scales=np.full_like(targets, scales),
        lengths=(count,),
        alpha_x=ALPHA_X,
        alpha_z=25.0,
    )


def test_basis_functions_worked_by_hand():
    # Two functions: c = 1 and exp(-alpha), sigma = overlap alpha c.
    basis = even_basis(2, 0.5, 2.0)
    c2 = np.exp(-2.0)
    psi = np.exp(-0.5 * np.array([(0.5 - 1) / 1.0, (0.5 - c2) / c2]) ** 2)
    np.testing.assert_allclose(basis.activations([0.5])[0], psi / psi.sum())
    np.testing.assert_allclose(basis.features([0.5])[0], 0.5 * psi / psi.sum())


def test_slopes_worked_by_hand():
    basis = even_basis(2, 0.5, 2.0, slopes=True)
    z = np.array([(0.5 - 1) / 1.0, (0.5 - np.exp(-2.0)) / np.exp(-2.0)])
    psi = np.exp(-0.5 * z**2)
    h = psi / psi.sum()
    np.testing.assert_allclose(basis.features([0.5])[0], 0.5 * np.concatenate((h, h * z)))
    weights = np.arange(4.0)[:, None]
    model = GaussianForcing(basis, weights)
    np.testing.assert_allclose(model([0.5]), basis.features([0.5]) @ weights)


@pytest.mark.parametrize("count", [1, 4, 40])  # A step's few phases take another path.
@pytest.mark.parametrize("normalized", [True, False])
@pytest.mark.parametrize("slopes", [True, False])
def test_an_offset_is_added_to_the_basis_functions_before_the_gate(count, normalized, slopes):
    basis = even_basis(7, 0.6, ALPHA_X, normalized=normalized, slopes=slopes)
    rng = np.random.default_rng(count)
    phases = np.exp(-ALPHA_X * np.linspace(0.0, 1.2, count))
    weights, offset = rng.normal(size=(basis.num_features, 3)), rng.normal(size=3)
    expected = basis.features(phases) @ weights + gate(phases, ALPHA_X)[:, None] * offset
    np.testing.assert_allclose(basis.combine(phases, weights, offset), expected, atol=1e-14)
    without = basis.features(phases) @ weights
    np.testing.assert_allclose(basis.combine(phases, weights), without, atol=1e-14)


@given(st.integers(1, 80), st.floats(1e-12, 1.0))
def test_activations_add_up_to_one_and_never_fail(num_basis, phase):
    activations = even_basis(num_basis, 0.4, ALPHA_X).activations([phase])
    assert activations.sum() == pytest.approx(1.0)
    assert np.all(activations >= 0)


def test_centres_are_even_in_time():
    times = -np.log(even_basis(9, 0.4, ALPHA_X).centres) / ALPHA_X
    np.testing.assert_allclose(times, np.linspace(0, 1, 9), atol=1e-14)


def test_the_same_basis_is_one_object():
    assert even_basis(40, 0.4, ALPHA_X) is even_basis(40, 0.4, ALPHA_X)


def test_lwr_weights_worked_by_hand():
    # B.1 in its closed form: w_i = sum psi_i x f / sum psi_i x^2.
    data = make_data(lambda s: np.column_stack((np.sin(4 * s), s, 1 - s)))
    model = get_approximator("lwr").fit(data, 5, 0)
    for i, (c, sigma) in enumerate(zip(model.basis.centres, model.basis.widths, strict=True)):
        psi = np.exp(-((data.phases - c) ** 2) / (2 * sigma**2))
        expected = (psi * data.phases) @ data.targets / (psi @ data.phases**2)
        np.testing.assert_allclose(model.weights[i], expected)


def test_lwr_slopes_are_the_weighted_lines():
    data = make_data(lambda s: np.column_stack((np.sin(4 * s), s, 1 - s)))
    model = get_approximator("lwr_slopes").fit(data, 5, 0)
    x = data.phases
    for i in (0, 2, 4):
        offsets = (x - model.basis.centres[i]) / model.basis.widths[i]
        root = np.exp(-0.25 * offsets**2)
        columns = np.column_stack((x, x * offsets)) * root[:, None]
        expected = np.linalg.lstsq(columns, data.targets * root[:, None], rcond=None)[0]
        np.testing.assert_allclose(model.weights[[i, i + 5]], expected, rtol=1e-5, atol=1e-7)


def test_rbfn_is_the_least_squares_solution():
    data = make_data(lambda s: np.column_stack((np.sin(4 * s), s, 1 - s)))
    model = get_approximator("rbfn").fit(data, 8, 0)
    assert not model.basis.normalized
    columns = model.features(data.phases)
    expected = np.linalg.lstsq(columns, data.targets, rcond=None)[0]
    np.testing.assert_allclose(model(data.phases), columns @ expected, atol=1e-8)


@pytest.mark.parametrize("name", OURS)
def test_contract(name):
    data = make_data(lambda s: np.column_stack((np.sin(4 * s), s, 1 - s)))
    model = get_approximator(name).fit(data, 12, 0)
    assert isinstance(model, ForcingModel)
    assert isinstance(model, LinearForcingModel)
    assert model.num_basis == 12
    assert model.num_dimensions == 3
    phases = data.phases[::7]
    np.testing.assert_allclose(model(phases), model.features(phases) @ model.weights, atol=1e-12)
    np.testing.assert_array_equal(model.with_weights(2 * model.weights).weights, 2 * model.weights)
    loaded = get_approximator(name).load(model.to_data())
    np.testing.assert_array_equal(loaded(phases), model(phases))
    # It goes to zero with the phase.
    late = phase_at(np.array([1.0, 2.0, 4.0]), ALPHA_X)
    bound = np.abs(model(late[:1])).max() / late[0]
    assert np.all(np.abs(model(late)) <= late[:, None] * bound * (1 + 1e-9))


@pytest.mark.parametrize("name", OURS)
def test_one_basis_function_and_more_than_samples_are_fine(name):
    data = make_data(lambda s: np.column_stack((s, s, s)), count=21)
    for num_basis in (1, 2, 60):
        model = get_approximator(name).fit(data, num_basis, 0)
        assert np.isfinite(model(data.phases)).all()


@pytest.mark.parametrize("normalized", [True, False])
@pytest.mark.parametrize("slopes", [True, False])
def test_few_phases_give_what_many_give(normalized, slopes):
    basis = even_basis(7, 0.8, ALPHA_X, normalized, slopes)
    weights = np.random.default_rng(0).normal(size=(basis.num_features, 3))
    phases = phase_at(np.linspace(0.0, 1.5, 40), ALPHA_X)
    few = np.concatenate([basis.combine(some, weights) for some in phases.reshape(10, 4)])
    np.testing.assert_allclose(few, basis.features(phases) @ weights, atol=1e-12)


def test_ridge_decides_only_what_data_leave_open():
    rng = np.random.default_rng(0)
    columns = rng.normal(size=(30, 4))
    twice = np.column_stack((columns, columns[:, 0]))
    weights = ridge_solver(twice) @ columns[:, 0]
    np.testing.assert_allclose(weights, [0.5, 0, 0, 0, 0.5], atol=1e-4)
    targets = rng.normal(size=(30, 2))
    expected = np.linalg.lstsq(columns, targets, rcond=None)[0]
    np.testing.assert_allclose(ridge_solver(columns) @ targets, expected, atol=1e4 * RIDGE)


def test_scales_weigh_the_residuals():
    columns = np.ones((2, 1))
    targets = np.array([[1.0, 1.0], [3.0, 3.0]])
    scales = np.array([[1.0, 3.0], [1.0, 1.0]])
    found = ridge_regression(columns, targets, scales)
    np.testing.assert_allclose(found, [[2.0, (9 * 1 + 3) / 10]], atol=1e-9)


def test_fade_out_is_one_during_the_motion_and_falls_after_it():
    times = np.array([0.0, 0.5, 1.0, 2.0])
    np.testing.assert_allclose(
        fade_out(phase_at(times, ALPHA_X), ALPHA_X), [1, 1, 1, np.exp(-3 * ALPHA_X)]
    )


def test_an_unknown_name_lists_the_known_ones():
    assert set(OURS) <= set(approximator_names())
    with pytest.raises(InputError, match="trajectory_slopes"):
        get_approximator("lwrr")
