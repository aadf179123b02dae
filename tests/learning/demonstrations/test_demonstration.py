import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.learning import Demonstration
from pepper_drake.learning import rotations as so3


def times(count=21, step=0.05):
    return np.arange(count) * step


def test_derives_exact_velocities_of_a_quintic_with_uneven_times():
    t = np.sort(np.random.default_rng(0).uniform(0, 2, 40))
    p = np.column_stack((t**5 - t, 2 * t**4, t**2))
    demo = Demonstration.from_positions(t, p)
    np.testing.assert_allclose(demo.velocities[:, 0], 5 * t**4 - 1, atol=1e-8)
    np.testing.assert_allclose(demo.accelerations[:, 1], 24 * t**2, atol=1e-6)
    assert "quintic spline" in demo.derivation


def test_says_that_recorded_derivatives_are_as_recorded(demonstration):
    assert demonstration.derivation == "as recorded"


def test_derives_accelerations_of_given_velocities():
    t = times()
    demo = Demonstration.from_positions(
        t, np.column_stack((t, t, t)), np.column_stack((t**3, t, 0 * t))
    )
    np.testing.assert_allclose(demo.accelerations[:, 0], 3 * t**2, atol=1e-10)
    assert "velocities" in demo.derivation


def test_quaternion_signs_become_continuous():
    t = times()
    q = so3.exp_map(np.outer(t, [0, 0, 3.0]))
    flipped = q * np.where(np.arange(len(t)) % 3 == 0, -1.0, 1.0)[:, None]
    demo = Demonstration.from_positions(t, np.zeros((len(t), 3)), rotations=flipped)
    assert np.all(np.sum(demo.rotations[1:] * demo.rotations[:-1], axis=1) > 0)


@pytest.mark.parametrize(
    ("t", "p", "message"),
    [
        ([0, 1, 2], np.zeros((3, 3)), "N >= 4"),
        ([0, 1, 2, 3], np.zeros((4, 2)), r"\(N, 3\)"),
        ([0, 1, 1, 3], np.zeros((4, 3)), "increase"),
        ([0, 1, 2, 3], np.full((4, 3), np.nan), "not finite"),
        ([0, 1, 2, 3], np.zeros((4, 3)) + 1j, "complex"),
        ([0, 1, 2, 3], np.ma.masked_equal(np.zeros((4, 3)), 0), "masked"),
        ([0, 1, 2, 3], [[1, 2], [3]], "not an array"),
    ],
)
def test_refuses_bad_arrays(t, p, message):
    with pytest.raises(InputError, match=message):
        Demonstration.from_positions(t, p)


@pytest.mark.parametrize("names", [("a", "a"), (1, 2)])
def test_refuses_joints_of_one_name_and_of_none(names):
    with pytest.raises(InputError, match="different words"):
        Demonstration.from_positions(
            times(4), np.zeros((4, 3)), joints=np.zeros((4, 2)), joint_names=names
        )


def test_mirroring_twice_gives_the_motion_back(demonstration):
    twice = demonstration.mirrored().mirrored()
    np.testing.assert_array_equal(twice.positions, demonstration.positions)
    np.testing.assert_array_equal(twice.rotations, demonstration.rotations)
    np.testing.assert_array_equal(twice.joints, demonstration.joints)
    assert twice.joint_names == demonstration.joint_names


def test_mirrored_motion_is_the_reflection_in_the_plane_y_is_zero(demonstration):
    mirrored = demonstration.mirrored()
    reflection = np.diag([1.0, -1.0, 1.0])
    np.testing.assert_allclose(mirrored.positions, demonstration.positions @ reflection)
    # R mirrored is S R S for every vector.
    vector = np.array([0.3, -0.5, 0.8])
    for q, m in zip(demonstration.rotations[::50], mirrored.rotations[::50], strict=True):
        expected = reflection @ rotate(q, reflection @ vector)
        np.testing.assert_allclose(rotate(m, vector), expected, atol=1e-12)
    assert mirrored.joint_names == ("LShoulderPitch", "LShoulderRoll", "LElbowYaw")
    np.testing.assert_array_equal(mirrored.joints[:, 0], demonstration.joints[:, 0])
    np.testing.assert_array_equal(mirrored.joints[:, 1], -demonstration.joints[:, 1])


def rotate(q, vector):
    return so3.multiply(so3.multiply(q, [0.0, *vector]), so3.conjugate(q))[1:]


def test_trimming_removes_rest_and_keeps_one_sample_of_it():
    t = np.arange(301) * 0.01
    s = np.clip((t - 1.0) / 1.0, 0, 1)
    p = np.column_stack((s**3 * (10 - 15 * s + 6 * s**2), 0 * t, 0 * t)) * 0.3
    demo = Demonstration.from_positions(t, p).trimmed(speed=0.01)
    assert 1.0 <= demo.times[0] < 1.12
    assert 1.88 < demo.times[-1] <= 2.0
    speeds = np.linalg.norm(demo.velocities, axis=1)
    assert speeds[0] <= 0.01 < speeds[1]
    assert speeds[-1] <= 0.01 < speeds[-2]


def test_trimming_keeps_a_turn_in_place():
    t = np.arange(201) * 0.01
    q = so3.exp_map(np.outer(np.clip(t - 0.5, 0, 1), [0, 0, 1.0]))
    demo = Demonstration.from_positions(t, np.zeros((201, 3)), rotations=q).trimmed()
    assert demo.times[0] == pytest.approx(0.5, abs=0.03)
    assert demo.times[-1] == pytest.approx(1.5, abs=0.03)


def test_trimming_refuses_a_hand_that_rests():
    with pytest.raises(InputError, match="never moves"):
        Demonstration.from_positions(times(), np.zeros((21, 3))).trimmed()


@pytest.mark.parametrize(("frequency", "gain"), [(0.5, 1.0), (6.0, 0.5), (30.0, 0.0)])
def test_smoothing_passes_low_and_stops_high_frequencies(frequency, gain):
    t = np.arange(1001) * 0.004
    wave = np.sin(2 * np.pi * frequency * t)
    demo = Demonstration.from_positions(t, np.column_stack((wave, wave, wave))).smoothed(6.0)
    middle = slice(300, 700)
    found = np.dot(demo.positions[middle, 0], wave[middle]) / np.dot(wave[middle], wave[middle])
    assert found == pytest.approx(gain, abs=0.01)
    assert "6 Hz" in demo.derivation


@given(st.tuples(*[st.floats(-2, 2)] * 3))
def test_translation_moves_positions_only(offset):
    demo = Demonstration.from_positions(times(), np.outer(times() ** 2, [1, 2, 3]))
    moved = demo.translated(offset)
    np.testing.assert_allclose(moved.positions - demo.positions, [offset] * 21, atol=1e-12)
    np.testing.assert_array_equal(moved.velocities, demo.velocities)
