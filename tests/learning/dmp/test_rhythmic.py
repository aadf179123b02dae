from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.synthetic import example_demonstrations
from pepper_drake.learning.dmp.rhythmic import (
    RhythmicPrimitive,
    circular_features,
    find_period,
    fit_rhythmic,
    steady_responses,
)

PERIOD = 1.3


def wave(duration=4.0, period=PERIOD):
    """Waving with some harmonics."""
    t = np.arange(0, duration, 0.01)
    a = 2 * np.pi / period * t
    x = 0.2 + 0.1 * np.cos(a) + 0.02 * np.cos(2 * a + 1)
    y = -0.2 + 0.08 * np.sin(a) + 0.01 * np.sin(3 * a)
    z = 0.1 + 0.03 * np.sin(2 * a)
    return Demonstration.from_positions(t, np.column_stack((x, y, z)))


@pytest.fixture(scope="module")
def primitive():
    return fit_rhythmic(wave())


def test_response_to_one_harmonic_worked_by_hand():
    # f = cos(phi) drives y'' + 2 y' + y to cos(phi) / |(j + 1)^2| = 1 / 2, a quarter period late:
    # (j + 1)^2 = 2 j. Weights cos(c_i) make nearly that forcing term, as h grows with K.
    num_basis, concentration = 60, 40.0
    weights = np.cos(2 * np.pi * np.arange(num_basis) / num_basis)
    phases = np.linspace(0, 2 * np.pi, 9)
    force = circular_features(phases, num_basis, concentration) @ weights
    size = force[0]
    np.testing.assert_allclose(force, size * np.cos(phases), atol=1e-9)
    position, rate = steady_responses(phases, num_basis, concentration, 2.0) @ weights
    np.testing.assert_allclose(position, 0.5 * size * np.sin(phases), atol=1e-9)
    np.testing.assert_allclose(rate, 0.5 * size * np.cos(phases), atol=1e-9)


def test_period_is_found():
    assert find_period(wave()) == pytest.approx(PERIOD, rel=1e-4)
    assert find_period(wave(duration=7.0, period=2.1)) == pytest.approx(2.1, rel=1e-4)


def test_gives_back_what_was_shown(primitive):
    demo = wave()
    path = primitive.rollout(demo.duration)
    np.testing.assert_allclose(path.positions, demo.positions, atol=1e-5)
    np.testing.assert_allclose(path.velocities, demo.velocities, atol=1e-3)
    np.testing.assert_allclose(path.accelerations[5:-5], demo.accelerations[5:-5], atol=0.1)


def test_is_the_differential_equation(primitive):
    tau = 0.9 / (2 * np.pi)
    start = np.array([0.3, 0.0, 0.0])

    def rate(time, state):
        y, z = state[:3], state[3:]
        force = 1.5 * primitive.forcing([time / tau])[0]
        pull = primitive.alpha_z * (primitive.alpha_z / 4 * (primitive.centre - y) - z)
        return np.concatenate((z, pull + force)) / tau

    path = primitive.rollout(1.0, start=start, period=0.9, amplitude=1.5)
    solution = solve_ivp(
        rate, (0, 1.0), np.concatenate((start, np.zeros(3))), t_eval=path.times, rtol=1e-9
    )
    np.testing.assert_allclose(path.positions, solution.y[:3].T, atol=1e-5)
    np.testing.assert_allclose(path.velocities, solution.y[3:].T / tau, atol=1e-3)


@settings(max_examples=15)
@given(
    start=st.lists(st.floats(-1, 1), min_size=3, max_size=3),
    velocity=st.lists(st.floats(-2, 2), min_size=3, max_size=3),
    phase=st.floats(0, 6.28),
)
def test_reaches_the_limit_cycle_from_any_start(start, velocity, phase):
    primitive = fit_rhythmic(wave(), period=PERIOD, num_basis=15)
    path = primitive.rollout(2.0, start=start, start_velocity=velocity, start_phase=phase)
    positions, velocities = primitive.limit_cycle(path.phases[150:])
    np.testing.assert_allclose(path.positions[150:], positions, atol=1e-4)
    np.testing.assert_allclose(path.velocities[150:], velocities, atol=1e-3)


def test_period_amplitude_and_centre_scale_the_cycle(primitive):
    slow = primitive.rollout(2 * PERIOD, period=2 * PERIOD, time_step=0.02)
    plain = primitive.rollout(PERIOD, time_step=0.01)
    np.testing.assert_allclose(slow.positions, plain.positions, atol=1e-6)
    large = primitive.rollout(PERIOD, amplitude=2.0, centre=[0.5, 0.0, 0.0])
    np.testing.assert_allclose(
        large.positions - [0.5, 0.0, 0.0], 2 * (plain.positions - primitive.centre), atol=1e-9
    )


def test_changes_while_running_do_not_jump(primitive):
    state = np.stack([value[0] for value in primitive.limit_cycle([0.0])])
    phase, states = 0.0, [state]
    for step in range(2000):
        faster = step >= 1000
        state, phase = primitive.advance(
            state, phase, 0.001, period=0.8 if faster else None, amplitude=0.5 if faster else 1.0
        )
        states.append(state)
    positions, velocities = np.moveaxis(np.array(states), 1, 0)
    travelled = 0.0005 * (velocities[1:] + velocities[:-1])
    np.testing.assert_allclose(np.diff(positions, axis=0), travelled, atol=1e-5)
    half = 0.5 * (primitive.limit_cycle([phase])[0] - primitive.centre) + primitive.centre
    np.testing.assert_allclose(positions[-1], half[0], atol=1e-4)


def test_time_step_does_not_change_the_motion(primitive):
    coarse = primitive.rollout(2.0, 0.02, start=[0.5, 0.5, 0.5]).positions
    fine = primitive.rollout(2.0, 0.001, start=[0.5, 0.5, 0.5]).positions
    np.testing.assert_allclose(coarse, fine[::20], atol=1e-5)


def test_a_file_gives_it_back_bit_for_bit(primitive, tmp_path):
    primitive.save(tmp_path / "wave.yaml")
    loaded = RhythmicPrimitive.load(tmp_path / "wave.yaml")
    np.testing.assert_array_equal(loaded.rollout(1.0).positions, primitive.rollout(1.0).positions)


def test_bad_input_is_refused(primitive, tmp_path):
    with pytest.raises(InputError, match="no period found"):
        find_period(example_demonstrations(1)[0])
    with pytest.raises(InputError, match="show at least one period"):
        fit_rhythmic(wave(duration=1.0), period=1.3)
    with pytest.raises(InputError, match="num_basis: 2"):
        fit_rhythmic(wave(), num_basis=2)
    with pytest.raises(InputError, match="period: -1"):
        primitive.rollout(1.0, period=-1.0)
    (tmp_path / "other.yaml").write_text("weights: 3\n")
    with pytest.raises(InputError, match="not a rhythmic primitive"):
        RhythmicPrimitive.load(tmp_path / "other.yaml")


def test_the_orientation_turns_with_the_same_period(tmp_path):
    times = np.arange(0.0, 6.0, 0.01)
    phase = 2 * np.pi * times / 1.5
    turns = np.column_stack((0.3 * np.sin(phase), 0.1 * np.cos(phase), 0.2 * np.sin(2 * phase)))
    middle = so3.from_angles([0.4, -0.2, 1.0])
    rotations = so3.multiply(so3.exp_map(turns), np.broadcast_to(middle, (len(times), 4)))
    positions = 0.1 * np.column_stack((np.sin(phase), np.cos(phase), 0 * phase))
    demo = Demonstration.from_positions(times, positions, rotations=rotations)
    primitive = fit_rhythmic(demo)
    path = primitive.rollout(5.99, 0.01)
    apart = so3.log_map(so3.multiply(path.rotations, so3.conjugate(rotations)))
    assert np.linalg.norm(apart, axis=1).max() < 2e-3
    step = so3.log_map(so3.multiply(path.rotations[1:], so3.conjugate(path.rotations[:-1])))
    middles = 0.5 * (path.angular_velocities[1:] + path.angular_velocities[:-1])
    np.testing.assert_allclose(step / 0.01, middles, atol=5e-3)
    primitive.save(tmp_path / "wave.yaml")
    back = RhythmicPrimitive.load(tmp_path / "wave.yaml")
    np.testing.assert_array_equal(back.rotation_weights, primitive.rotation_weights)
    assert fit_rhythmic(Demonstration.from_positions(times, positions)).orientation([0.0]) is None
    for broken in (
        replace(primitive, rotation_weights=primitive.rotation_weights[1:]),
        replace(primitive, rotation_weights=np.nan * primitive.rotation_weights),
        replace(primitive, rotation_weights=None),
        replace(primitive, rotation_centre=np.zeros(4)),
        replace(primitive, rotation_centre=None),
    ):
        broken.save(tmp_path / "broken.yaml")
        with pytest.raises(InputError, match="rotation_"):
            RhythmicPrimitive.load(tmp_path / "broken.yaml")
