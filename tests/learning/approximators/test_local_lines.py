import json

import numpy as np
import pytest
from pydrake.autodiffutils import AutoDiffXd, InitializeAutoDiff

from pepper_drake.errors import InputError
from pepper_drake.learning.approximators.gmr import GmrForcing, fit_gmr, from_mixture
from pepper_drake.learning.approximators.local_lines import LineBasis, LocalLines
from pepper_drake.learning.approximators.lwpr import fit_lwpr
from pepper_drake.learning.approximators.registry import ForcingData, LinearForcingModel, fade_out
from pepper_drake.learning.probabilistic.gaussian_mixture import GaussianMixture

ALPHA_X = 25 / 3


def forcing_data(count=200):
    times = np.linspace(0, 1, count)
    targets = np.column_stack([100 * np.sin(7 * times), 20 * times**2 - 5])
    nothing = np.zeros_like(targets)
    return ForcingData(
        np.exp(-ALPHA_X * times), times, targets, nothing, nothing + 1, (count,), ALPHA_X, 25.0
    )


@pytest.fixture(params=[fit_gmr, fit_lwpr], ids=["gmr", "lwpr"], scope="module")
def model(request):
    return request.param(forcing_data(), 20, 0)


def test_follows_the_samples(model):
    data = forcing_data()
    scale = data.targets.std(axis=0)
    error = np.sqrt(np.mean((model(data.phases) - data.targets) ** 2, axis=0))
    assert np.all(error < 0.01 * scale)


def test_is_linear_in_its_weights(model):
    assert isinstance(model, LinearForcingModel)
    phases = forcing_data().phases
    doubled = model.with_weights(2 * model.weights)
    np.testing.assert_array_equal(doubled(phases), 2 * model(phases))
    np.testing.assert_array_equal(model.features(phases) @ model.weights, model(phases))


def test_fades_after_the_end(model):
    end = model(np.exp([-ALPHA_X]))
    phases = np.exp(-ALPHA_X * np.array([1.5, 2.0, 3.0]))
    later = model(phases)
    np.testing.assert_allclose(later, end * fade_out(phases, ALPHA_X)[:, None], rtol=1e-9)
    assert np.abs(later[0]).max() < 0.1 * np.abs(end).max()


def test_plain_data_gives_it_back_bit_for_bit(model):
    phases = np.exp(-ALPHA_X * np.linspace(0, 1.2, 77))
    restored = type(model).from_data(json.loads(json.dumps(model.to_data())))
    np.testing.assert_array_equal(restored(phases), model(phases))


def test_derivatives_pass_through(model):
    phases = np.exp(-ALPHA_X * np.array([0.1, 0.55, 0.9]))
    values = model(InitializeAutoDiff(phases)[:, 0])
    step = 1e-7 * phases
    slopes = (model(phases + step) - model(phases - step)) / (2 * step[:, None])
    assert isinstance(values[0, 0], AutoDiffXd)
    for n in range(3):
        np.testing.assert_allclose(values[n, 0].value(), model(phases)[n, 0])
        np.testing.assert_allclose(values[n, 0].derivatives()[n], slopes[n, 0], rtol=1e-4)


def test_two_lines_worked_by_hand():
    # At s = 0.25, as near to one centre as to the other: half of (2 + 4 * 0.25) and of (6 - 0.25).
    basis = LineBasis(ALPHA_X, np.zeros(2), np.array([0.0, 0.5]), np.array([0.04, 0.04]))
    lines = LocalLines(basis, np.array([[2.0], [6.0], [4.0], [1.0]]))
    np.testing.assert_allclose(lines(np.exp([-ALPHA_X * 0.25])), [[0.5 * 3.0 + 0.5 * 5.75]])


def test_mixture_says_the_same_as_its_lines():
    rng = np.random.default_rng(0)
    roots = rng.standard_normal((4, 3, 3))
    mixture = GaussianMixture(
        np.array([0.1, 0.4, 0.5, 0.0]),
        np.column_stack([[0.1, 0.5, 0.8, 0.3], rng.standard_normal((4, 2))]),
        0.05 * roots @ np.swapaxes(roots, 1, 2) + 0.01 * np.eye(3),
    )
    times = np.linspace(0, 1, 9)
    phases = np.exp(-ALPHA_X * times)
    forcing = from_mixture(mixture, ALPHA_X)
    regression = mixture.regress(times[:, None])
    assert forcing.num_basis == 3
    assert isinstance(forcing, GmrForcing)
    np.testing.assert_allclose(forcing(phases), regression.means)
    np.testing.assert_allclose(forcing.covariances(phases), regression.covariances)


@pytest.mark.parametrize(("fit", "num_basis"), [(fit_gmr, 0), (fit_gmr, 201), (fit_lwpr, 0)])
def test_impossible_numbers_of_basis_functions_are_refused(fit, num_basis):
    with pytest.raises(InputError, match=f"is {num_basis}; choose 1"):
        fit(forcing_data(), num_basis, 0)
