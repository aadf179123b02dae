import numpy as np
import pytest

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.scaling import SCALINGS
from pepper_drake.learning.phase import phase_at
from pepper_drake.optimization import all_weights, smooth_bumps
from pepper_drake.optimization.fast_rollouts import roll_out
from tests.optimization.conftest import DEMONSTRATION


def test_parameters_of_zero_are_the_primitive(primitive):
    parameters = all_weights(primitive)
    assert parameters.size == 3 * (len(primitive.weights) + 1)
    same = parameters.primitive_at(np.zeros(parameters.size))
    assert np.allclose(same.rollout().positions, primitive.rollout().positions, atol=1e-12)


def test_a_parameter_of_one_metre_moves_the_hand_by_one_metre_where_it_moves_it_most(primitive):
    parameters = all_weights(primitive)
    still = roll_out(parameters, np.zeros((1, parameters.size)), 0.01).positions[0]
    for row in (0, 5, 11, 20, parameters.rows - 1):
        x = np.zeros((parameters.rows, 3))
        x[row, 1] = 1.0
        moved = roll_out(parameters, x.ravel()[None], 0.01).positions[0] - still
        assert np.abs(moved[:, 1]).max() == pytest.approx(1.0, abs=0.01)
        assert np.abs(moved[:, [0, 2]]).max() < 1e-9


@pytest.mark.parametrize("scaling", SCALINGS)
def test_a_found_primitive_does_by_itself_what_was_rolled_out(scaling):
    primitive = MovementPrimitive.fit(DEMONSTRATION, num_basis=12, scaling=scaling)
    parameters = all_weights(primitive)
    x = 0.02 * np.random.default_rng(0).standard_normal((3, parameters.size))
    paths = roll_out(parameters, x, 0.01)
    for k in range(3):
        found = parameters.primitive_at(x[k])
        path = found.rollout()
        assert found.goal == pytest.approx(primitive.goal + x[k, -3:])
        assert np.abs(path.positions - paths.positions[k]).max() < 1e-7
        assert np.abs(path.accelerations - paths.accelerations[k]).max() < 1e-4


def test_a_found_primitive_survives_its_file(primitive, tmp_path):
    parameters = all_weights(primitive)
    found = parameters.primitive_at(np.full(parameters.size, 0.01))
    found.save(tmp_path / "found.yaml")
    again = MovementPrimitive.load(tmp_path / "found.yaml")
    assert np.array_equal(again.rollout().positions, found.rollout().positions)


def test_bumps_leave_start_and_end_alone(primitive):
    parameters = smooth_bumps(primitive, 4, end_state=False)
    assert parameters.size == 12
    still = roll_out(parameters, np.zeros((1, 12)), 0.01)
    peaks = []
    for row in range(4):
        x = np.zeros((4, 3))
        x[row, 2] = 0.1
        moved = roll_out(parameters, x.ravel()[None], 0.01).positions[0, :, 2]
        moved = moved - still.positions[0, :, 2]
        assert abs(moved[0]) < 1e-9
        assert abs(moved[-1]) < 0.004
        peaks.append(np.argmax(moved))
        assert moved.max() == pytest.approx(0.1, abs=0.01)
    assert np.all(np.diff(peaks) > 10)


@pytest.mark.parametrize("scaling", ["gradual", "none"])
def test_features_are_what_a_parameter_adds_to_the_acceleration(scaling):
    primitive = MovementPrimitive.fit(DEMONSTRATION, num_basis=12, scaling=scaling)
    parameters = all_weights(primitive)
    x = 0.01 * np.random.default_rng(1).standard_normal(parameters.size)
    found = parameters.primitive_at(x)
    phases = phase_at(np.linspace(0, 1, 50), primitive.translation.alpha_x)
    spring = 0.25 * primitive.translation.alpha_z**2
    added = found.translation.model(phases) - primitive.translation.model(phases)
    added += spring * (found.goal - primitive.goal)
    assert np.allclose(parameters.features(50) @ x.reshape(-1, 3), added, atol=1e-8)


def test_bad_input(primitive):
    with pytest.raises(InputError, match=r"shape \(2, 5\); give \(S, 75\)"):
        all_weights(primitive).weights_and_goals(np.zeros((2, 5)))
    with pytest.raises(InputError, match="kernels: 0"):
        smooth_bumps(primitive, 0)
