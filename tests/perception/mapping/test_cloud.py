import numpy as np
import pytest
from pydrake.geometry import Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import CAMERA_DEPTH, pixel_rays
from pepper_drake.perception.mapping.cloud import (
    CloudParameters,
    depth_in_metres,
    inverse_depth_gradient,
    observe_surfaces,
    remove_solids,
    surface_pixels,
    thin_pixels,
    to_point_cloud,
)
from pepper_drake.perception.mapping.solids import Solid, SolidSet

CAMERA = CAMERA_DEPTH.intrinsics
PARAMETERS = CloudParameters()
# Looks along +x from 1 m above the floor, half a radian down.
X_WC = RigidTransform(RollPitchYaw(-np.pi / 2 - 0.5, 0, -np.pi / 2), [0, 0, 1.0])


def plane_depth(normal_W, offset, X_WC=X_WC):
    """Depth image of the plane normal . p = offset, 0 where it is not seen."""
    rays = pixel_rays(CAMERA).astype(float)
    n_C = X_WC.rotation().matrix().T @ normal_W
    with np.errstate(divide="ignore"):
        z = (offset - np.dot(normal_W, X_WC.translation())) / (rays @ n_C)
    return np.where((z > CAMERA.near) & (z < CAMERA.far), z, 0).astype(np.float32)


def test_depth_of_every_kind_becomes_metres():
    millimetres = np.zeros((240, 320, 1), np.uint16)
    millimetres[0, 0], millimetres[0, 1], millimetres[0, 2] = 1234, 399, 65535
    metres = depth_in_metres(millimetres, CAMERA)
    assert metres[0, 0] == pytest.approx(1.234, abs=1e-6)
    assert not metres[0, 1:].any()
    floating = np.full((240, 320), 1.5, np.float32)
    floating[0, :4] = [np.nan, np.inf, -np.inf, 0.1]
    metres = depth_in_metres(floating, CAMERA)
    assert not metres[0, :4].any()
    assert (metres[1:] == 1.5).all()


def test_images_without_pixels_hold_nothing():
    assert depth_in_metres(np.zeros((0, 0, 1), np.uint16), CAMERA).size == 0


@pytest.mark.parametrize("kind", [np.int16, np.int32, np.uint32, np.int64, np.float16, np.float64])
def test_every_type_of_number_is_read(kind):
    whole = np.issubdtype(kind, np.integer)
    image = np.full((240, 320), 1500 if whole else 1.5, kind)
    image[0, :2] = 0, 0 if np.issubdtype(kind, np.unsignedinteger) else -1
    metres = depth_in_metres(image, CAMERA)
    np.testing.assert_allclose(metres[1:], 1.5)
    assert not metres[0, :2].any()


def test_other_units_are_read_by_their_scale():
    fifths = np.full((240, 320), 7500, np.uint16)
    np.testing.assert_allclose(depth_in_metres(fifths, CAMERA, scale=0.0002), 1.5, rtol=1e-6)
    coarse = np.full((240, 320), 30, np.uint8)
    np.testing.assert_allclose(depth_in_metres(coarse, CAMERA, scale=0.05), 1.5, rtol=1e-6)
    floating = np.full((240, 320), 1500.0)
    np.testing.assert_allclose(depth_in_metres(floating, CAMERA, scale=0.001), 1.5, rtol=1e-6)


def test_values_by_which_drivers_say_nothing_are_nothing():
    image = np.full((240, 320), 1500, np.uint16)
    image[0, :2] = 65535, 2047
    assert not depth_in_metres(image, CAMERA)[0, :2].any()


@pytest.mark.parametrize(
    ("image", "words"),
    [
        (np.ones((120, 160), np.float32), "160x120"),
        (np.ones((240, 320, 3), np.uint16), "one channel"),
        (np.ones((240, 320), bool), "bool"),
        (np.full((240, 320), 1500.0, np.float32), "0.001"),
        (np.full((240, 320), 200, np.uint8), "scale"),
        (np.full((240, 320), 2, np.int32), "too coarse"),
        (np.full((240, 320), 150_000, np.uint32), "units of 0.001 m"),
    ],
)
def test_images_that_cannot_be_read_are_refused_with_the_mend(image, words):
    with pytest.raises(InputError, match=words):
        depth_in_metres(image, CAMERA)


@pytest.mark.parametrize("stride", [1, 2, 4])
def test_points_of_a_plane_lie_on_it_with_its_normal(stride):
    normal = np.array([-0.6, 0.0, 0.8])
    depth = plane_depth(normal, 0.0)
    surface = observe_surfaces(depth, CAMERA, X_WC, CloudParameters(stride=stride))
    assert len(surface.positions) > 2000 / stride**2
    np.testing.assert_allclose(surface.positions @ normal, 0, atol=1e-5)
    known = np.isfinite(surface.normals).all(axis=1)
    assert known.mean() > 0.6  # Of the border they are not.
    np.testing.assert_allclose(surface.normals[known], np.tile(normal, (known.sum(), 1)), atol=0.01)


def test_floor_and_far_points_are_left_out():
    depth = plane_depth(np.array([0, 0, 1.0]), 0.0)
    assert len(observe_surfaces(depth, CAMERA, X_WC, PARAMETERS).positions) == 0
    depth = plane_depth(np.array([0, 0, 1.0]), 0.4)
    points = observe_surfaces(depth, CAMERA, X_WC, PARAMETERS).positions
    distances = np.linalg.norm(points - X_WC.translation(), axis=1)
    assert 1.4 < distances.max() <= 1.5 + 1e-6


def test_flying_pixels_are_left_out_but_their_neighbours_stay():
    depth = np.full((240, 320), 1.3, np.float32)
    depth[:, 160:] = 0.9
    depth[:, 160] = np.linspace(0.95, 1.25, 240)  # A veil from one surface to the other.
    depth[50, 50] = 0.7  # And one alone.
    kept = surface_pixels(depth, CAMERA, PARAMETERS)
    in_between = (depth > 0.94) & (depth < 1.26)
    assert np.mean(kept[in_between]) < 0.15
    assert not kept[50, 50]
    assert kept[10:-10, 162:-2].all()
    assert kept[10:40, 2:158].all()


def test_surface_seen_at_a_grazing_angle_stays():
    depth = plane_depth(np.array([0, 0, 1.0]), 0.85)
    assert surface_pixels(depth, CAMERA, PARAMETERS)[depth > 0][:-700].mean() > 0.97


def test_gradient_is_exact_on_a_plane_and_unknown_at_jumps():
    depth = plane_depth(np.array([-0.6, 0.0, 0.8]), 0.0)
    a, b = inverse_depth_gradient(depth, CAMERA)
    rays = pixel_rays(CAMERA)
    x, y = rays[100, 100, :2], rays[100, 104, :2]
    slope = (1 / depth[100, 104] - 1 / depth[100, 100]) / (y[0] - x[0])
    assert a[100, 102] == pytest.approx(slope, abs=1e-3)
    depth[:, 160:] = 0.5
    assert np.isnan(inverse_depth_gradient(depth, CAMERA)[0][120, 158:162]).all()
    assert np.isfinite(b[120, 100])


def test_thinning_keeps_every_pixel_where_rows_are_far_apart():
    flat = np.full((240, 320), 1.0, np.float32)
    steep = plane_depth(np.array([0, 0, 1.0]), 0.85)
    shares = []
    for depth in (flat, steep):
        gradient = inverse_depth_gradient(depth, CAMERA)
        chosen = thin_pixels(depth, gradient, CAMERA, PARAMETERS)
        inside = (depth[2:-2, 2:-2] > 0.8) & (depth[2:-2, 2:-2] < 1.4)
        shares.append(chosen[2:-2, 2:-2][inside].mean())
    assert shares[0] == pytest.approx(0.25, abs=0.01)
    assert shares[1] > 0.45


def test_solids_are_cut_out():
    depth = np.full((240, 320), 1.0, np.float32)
    surface = observe_surfaces(
        depth, CAMERA, RigidTransform(RollPitchYaw(0, 0, 0), [0, 0, 1]), PARAMETERS
    )
    ball = Solid(Sphere(0.1), RigidTransform([0, 0, 2.0]))
    left = remove_solids(surface, SolidSet([ball]), 0.02)
    distance = np.linalg.norm(left.positions - [0, 0, 2], axis=1)
    assert 0 < len(left.positions) < len(surface.positions)
    assert distance.min() > 0.12


def test_empty_image_gives_an_empty_cloud():
    for depth in (np.zeros((0, 0), np.float32), np.zeros((240, 320), np.float32)):
        surface = observe_surfaces(depth, CAMERA, X_WC, PARAMETERS)
        assert surface.positions.shape == (0, 3)
        assert to_point_cloud(surface).size() == 0


def test_point_cloud_is_in_the_frame_asked_for():
    depth = plane_depth(np.array([-0.6, 0.0, 0.8]), 0.0)
    surface = observe_surfaces(depth, CAMERA, X_WC, PARAMETERS)
    X_TW = RigidTransform(RollPitchYaw(0.1, 0.2, 0.3), [1, 2, 3])
    cloud = to_point_cloud(surface, X_TW)
    np.testing.assert_allclose(cloud.xyzs(), X_TW @ surface.positions.T.astype(float), atol=1e-5)
    known = np.isfinite(surface.normals).all(axis=1)
    np.testing.assert_allclose(
        cloud.normals()[:, known],
        X_TW.rotation().matrix() @ surface.normals[known].T,
        atol=1e-5,
    )
    np.testing.assert_allclose(to_point_cloud(surface).xyzs(), surface.positions.T)
