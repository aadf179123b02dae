import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pepper_drake.learning import rotations as so3

vectors = st.tuples(*[st.floats(-3, 3)] * 3).map(np.array)
angles = st.tuples(st.floats(-3, 3), st.floats(-1.4, 1.4), st.floats(-3, 3)).map(np.array)


def scipy_rotation(q):
    return Rotation.from_quat(np.asarray(q), scalar_first=True)


@given(vectors)
def test_exponential_is_that_of_scipy(v):
    difference = scipy_rotation(so3.exp_map(v)) * Rotation.from_rotvec(v).inv()
    assert difference.magnitude() < 1e-12


@given(vectors)
def test_logarithm_inverts_the_exponential(v):
    assume(np.linalg.norm(v) < 3.1)
    np.testing.assert_allclose(so3.log_map(so3.exp_map(v)), v, atol=1e-12)
    np.testing.assert_allclose(so3.log_map(-so3.exp_map(v)), v, atol=1e-12)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-8, 0.9e-4, 1.1e-4])
def test_small_rotations_lose_nothing(size):
    v = size * np.array([0.6, 0.0, -0.8])
    np.testing.assert_allclose(so3.log_map(so3.exp_map(v)), v, rtol=1e-12, atol=1e-30)
    product = so3.left_jacobian(v) @ so3.inverse_left_jacobian(v)
    np.testing.assert_allclose(product, np.eye(3), atol=1e-14)


@given(vectors, vectors)
def test_product_composes(a, b):
    composed = scipy_rotation(so3.multiply(so3.exp_map(a), so3.exp_map(b)))
    expected = Rotation.from_rotvec(a) * Rotation.from_rotvec(b)
    assert (composed * expected.inv()).magnitude() < 1e-12


@given(vectors, vectors)
def test_left_jacobian_maps_rates_to_angular_velocity(v, rate):
    h = 1e-6
    later, earlier = so3.exp_map(v + h * rate), so3.exp_map(v - h * rate)
    omega = so3.log_map(so3.multiply(later, so3.conjugate(earlier))) / (2 * h)
    np.testing.assert_allclose(so3.left_jacobian(v) @ rate, omega, atol=1e-7)


@given(vectors)
def test_inverse_jacobian_inverts(v):
    product = so3.left_jacobian(v) @ so3.inverse_left_jacobian(v)
    np.testing.assert_allclose(product, np.eye(3), atol=1e-10)


@given(angles)
def test_angles_are_those_of_scipy(rpy):
    q = so3.from_angles(rpy)
    expected = Rotation.from_euler("xyz", rpy)
    assert (scipy_rotation(q) * expected.inv()).magnitude() < 1e-12
    np.testing.assert_allclose(so3.to_angles(q), rpy, atol=1e-9)


@given(angles, vectors)
def test_angle_rates_give_the_angular_velocity(rpy, rates):
    h = 1e-6
    later, earlier = so3.from_angles(rpy + h * rates), so3.from_angles(rpy - h * rates)
    omega = so3.log_map(so3.multiply(later, so3.conjugate(earlier))) / (2 * h)
    found = so3.angle_rates_to_angular_velocity(rpy, rates)
    np.testing.assert_allclose(found, omega, atol=1e-7)


@given(vectors, st.integers(-2, 2))
def test_nearest_logarithm_finds_the_branch(v, turns):
    assume(0.1 < np.linalg.norm(v) < 3.0)
    reference = v * (1 + 2 * np.pi * turns / np.linalg.norm(v))
    np.testing.assert_allclose(so3.nearest_log(so3.exp_map(v), reference), reference, atol=1e-9)


def test_nearest_logarithm_of_whole_turns():
    reference = np.array([0.0, 0.0, 6.2])
    np.testing.assert_allclose(
        so3.nearest_log(np.array([1.0, 0, 0, 0]), reference), [0, 0, 2 * np.pi]
    )


def test_unwrapped_logarithm_follows_more_than_half_a_turn():
    turn = np.linspace(5.0, 0.0, 200)[:, None] * np.array([0.0, 0.6, 0.8])
    np.testing.assert_allclose(so3.unwrapped_log(so3.exp_map(turn)), turn, atol=1e-12)


@given(vectors, vectors)
def test_one_alone_is_as_in_a_batch(v, rate):
    q = so3.exp_map(v)
    np.testing.assert_allclose(so3.exp_map(v[None])[0], q, atol=1e-15)
    np.testing.assert_allclose(so3.log_map(np.array([q, -q])), [so3.log_map(q)] * 2, atol=1e-13)
    np.testing.assert_allclose(so3.log_map(-q), so3.log_map(q), atol=1e-13)
    np.testing.assert_allclose(so3.normalize(2 * q[None])[0], so3.normalize(2 * q), atol=1e-15)
    batch = so3.angular_velocity(v[None], rate[None])[0]
    np.testing.assert_allclose(so3.angular_velocity(v, rate), batch, atol=1e-12)


@pytest.mark.parametrize("size", [0.0, 0.9e-4, 1.1e-4])
def test_angular_velocity_of_small_rotations_loses_nothing(size):
    v, rate = size * np.array([0.6, 0.0, -0.8]), np.array([0.3, -0.2, 0.5])
    expected = so3.left_jacobian(v) @ rate
    np.testing.assert_allclose(so3.angular_velocity(v, rate), expected, atol=1e-14)
