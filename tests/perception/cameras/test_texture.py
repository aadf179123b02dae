import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.perception.cameras.camera import CameraIntrinsics, pixel_rays
from pepper_drake.perception.cameras.texture import paint_texture, project_pattern, value_noise

CAMERA = CameraIntrinsics.from_vertical_fov(64, 48, 0.8)


@given(st.integers(0, 99), st.sampled_from([2, 3]))
def test_noise_is_continuous_bounded_and_a_function_of_the_seed(seed, dimensions):
    points = np.random.default_rng(seed).uniform(-50, 50, (100, dimensions))
    values = value_noise(points, seed)
    assert np.all((values >= 0) & (values <= 1))
    np.testing.assert_allclose(value_noise(points + 1e-4, seed), values, atol=1e-3)
    np.testing.assert_array_equal(value_noise(points, seed), values)
    assert np.abs(value_noise(points, seed + 1) - values).mean() > 0.1


def test_noise_is_random_on_the_lattice():
    corners = np.stack(np.meshgrid(*[np.arange(-20.0, 20.0)] * 2), -1).reshape(-1, 2)
    values = value_noise(corners, 3).reshape(40, 40)
    assert values.std() == pytest.approx(np.sqrt(1 / 12), rel=0.1)
    assert abs(np.corrcoef(values[:, 1:].ravel(), values[:, :-1].ravel())[0, 1]) < 0.08


def see(X_WC, paint):
    """Image of the wall z = 1: brightness, and where each pixel's point is."""
    rays = pixel_rays(CAMERA).astype(float)
    R = X_WC.rotation().matrix()
    depth = (1.0 - X_WC.translation()[2]) / (rays @ R[2])
    image = paint(np.full((48, 64, 4), 200, np.uint8), depth, X_WC)
    points = (rays * depth[..., None]) @ R.T + X_WC.translation()
    return image, points


def test_texture_is_fixed_to_the_surface():
    def paint(image, depth, X_WC):
        return paint_texture(image, depth, CAMERA, X_WC, grain=0.05)

    one, points = see(RigidTransform(), paint)
    other, seen = see(RigidTransform(RollPitchYaw(0, 0, 0.3), [0.02, 0, 0.1]), paint)
    # The nearest pixels of both show the same brightness.
    place = np.argmin(
        np.linalg.norm(points.reshape(-1, 3)[None] - seen[20:28, 30:34].reshape(-1, 1, 3), axis=2),
        axis=1,
    )
    difference = one.reshape(-1, 4)[place, 0].astype(int) - other[20:28, 30:34, 0].ravel()
    assert np.abs(difference).mean() < 12
    assert one[..., 0].std() > 15
    assert (one[..., 3] == 200).all()


def test_pattern_is_fixed_to_the_projector():
    X_WP = RigidTransform([0.05, 0, 0])

    def throw(image, depth, X_WC):
        return project_pattern(image, depth, CAMERA, X_WC, X_WP, grain=0.05)

    near, _ = see(X_WP, throw)
    shifted, _ = see(RigidTransform(RollPitchYaw(0, 0, 0), [0.05, 0, -0.5]), throw)
    # From the projector itself the pattern looks the same whatever it falls on.
    far = project_pattern(
        np.full((48, 64, 4), 200, np.uint8), np.full((48, 64), 3.0), CAMERA, X_WP, X_WP, grain=0.05
    )
    np.testing.assert_array_equal(near, far)
    assert np.any(near != shifted)


def test_only_what_is_there_and_meant_is_painted():
    image = np.full((48, 64, 3), 100, np.uint8)
    depth = np.full((48, 64), 1.0)
    depth[:10], depth[10:20] = np.inf, 0
    painted = np.ones((48, 64), dtype=bool)
    painted[20:30] = False
    result = paint_texture(image, depth, CAMERA, RigidTransform(), painted=painted)
    assert (result[:30] == 100).all()
    assert (result[30:] < 100).mean() > 0.9
    assert (image == 100).all()
