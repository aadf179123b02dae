import dataclasses

import cv2
import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH, CAMERA_TOP, pixel_rays
from pepper_drake.perception.cameras.noise import (
    ColorNoise,
    DepthNoise,
    apply_color_noise,
    apply_depth_noise,
    drop_dark_patches,
)

DEPTH = CAMERA_DEPTH.intrinsics
COLOR = CAMERA_TOP.intrinsics
NO_LOSS = DepthNoise(edge_loss=0, edge_mix=0, loss=0, border=0)


def flat(depth):
    return np.full((DEPTH.height, DEPTH.width), depth, np.float32)


@pytest.mark.parametrize("depth", [0.5, 1.0, 3.0])
def test_depth_noise_grows_as_stated(depth):
    # Of many depths, as whole steps of millimetres and of the disparity beat with one another.
    true = flat(depth) + np.linspace(-0.005, 0.005, DEPTH.width, dtype=np.float32)
    error = apply_depth_noise(true, DEPTH, NO_LOSS, seed=1, frame=0) / 1000 - true
    # 0.0012 + 0.0019 (z - 0.4)^2; rounding to millimetres adds 0.3 mm.
    expected = np.hypot(0.0012 + 0.0019 * (depth - 0.4) ** 2, 0.0003)
    assert error.std() == pytest.approx(expected, rel=0.05)
    assert abs(error.mean()) < expected / 20


def test_depth_is_whole_millimetres_within_range():
    depth = flat(1.0)
    depth[:10], depth[10:20], depth[20:30], depth[30:40] = 0.3, 9.0, np.inf, np.nan
    seen = apply_depth_noise(depth, DEPTH, NO_LOSS, seed=1, frame=0)
    assert seen.dtype == np.uint16
    assert not seen[:40].any()
    assert (seen[40:] > 900).all()


def test_edges_lose_pixels_and_mix_surfaces():
    depth = flat(2.0)
    depth[:, 160:] = 1.0
    seen = apply_depth_noise(depth, DEPTH, DepthNoise(loss=0, baseline=0), seed=1, frame=0) / 1000
    edge, inside = seen[:, 158:162], seen[:, :150]
    assert 0.15 < np.mean(edge == 0) < 0.4  # Half of the two columns at the edge.
    assert np.any((edge > 1.2) & (edge < 1.8))
    assert np.all(inside > 1.9)


def test_noise_is_a_function_of_seed_and_frame():
    def see(seed, frame):
        return apply_depth_noise(flat(1.0), DEPTH, DepthNoise(), seed=seed, frame=frame)

    np.testing.assert_array_equal(see(3, 5), see(3, 5))
    assert np.mean(see(3, 5) == see(3, 6)) < 0.5
    assert np.mean(see(3, 5) == see(4, 5)) < 0.5


def test_colour_noise_spares_the_alpha_channel():
    image = np.full((COLOR.height, COLOR.width, 4), 128, np.uint8)
    seen = apply_color_noise(image, COLOR.ideal(), ColorNoise(sigma=4.0), seed=0, frame=2)
    assert seen[..., :3].std() == pytest.approx(4.0, rel=0.05)
    assert (seen[..., 3] == 128).all()
    np.testing.assert_array_equal(
        apply_color_noise(image, COLOR.ideal(), ColorNoise(sigma=0.0), seed=0, frame=0), image
    )


def test_saturated_colours_stay_saturated():
    image = np.full((COLOR.height, COLOR.width, 4), 255, np.uint8)
    seen = apply_color_noise(image, COLOR, ColorNoise(), seed=0, frame=0)
    assert seen[..., :3].min() > 200  # Not wrapped around to black.


def test_finer_images_are_averaged():
    fine = np.zeros((2 * COLOR.height, 2 * COLOR.width, 4), np.uint8)
    fine[::2] = 200
    seen = apply_color_noise(fine, COLOR.ideal(), ColorNoise(sigma=0.0), seed=0, frame=0)
    assert seen.shape == (COLOR.height, COLOR.width, 4)
    assert (seen == 100).all()


def test_the_projector_lights_nothing_in_the_shadow_of_nearer_things():
    depth = flat(2.0)
    depth[:, 160:200] = 1.0
    noise = DepthNoise(edge_loss=0, edge_mix=0, loss=0, border=0, dark_fraction=0)
    blank = apply_depth_noise(depth, DEPTH, noise, seed=1, frame=0) == 0
    # f b (1/1 - 1/2) pixels beside the thing, on the side away from the projector.
    width = DEPTH.focal_x * 0.075 * 0.5
    assert np.all(np.abs(blank[:, :160].sum(axis=1) - width) <= 1.5)
    assert not blank[:, 160:].any()
    other = dataclasses.replace(noise, baseline=-0.075)
    blank = apply_depth_noise(depth, DEPTH, other, seed=1, frame=0) == 0
    assert np.all(np.abs(blank[:, 200:].sum(axis=1) - width) <= 1.5)
    assert not blank[:, :200].any()


def test_the_shadow_of_a_thin_thing_lies_beside_it():
    depth = flat(1.2)
    depth[:, 200:205] = 0.5
    noise = DepthNoise(edge_loss=0, edge_mix=0, loss=0, border=0, dark_fraction=0)
    blank = apply_depth_noise(depth, DEPTH, noise, seed=1, frame=0) == 0
    shift = DEPTH.focal_x * 0.075 * (1 / 0.5 - 1 / 1.2)
    columns = np.flatnonzero(blank[100])
    assert columns.min() == pytest.approx(200 - shift, abs=1.5)
    assert columns.max() == pytest.approx(204 - shift, abs=1.5)


def test_what_is_too_near_to_be_measured_casts_a_shadow_all_the_same():
    depth = flat(1.2)
    depth[:, 200:240] = 0.25
    blank = apply_depth_noise(depth, DEPTH, NO_LOSS, seed=1, frame=0) == 0
    shift = round(DEPTH.focal_x * 0.075 * (1 / 0.25 - 1 / 1.2))
    assert blank[:, 201 - shift : 239 - shift].all()


@pytest.mark.parametrize(("angle", "lost"), [(60.0, 0.0), (75.0, 0.0), (85.5, 1.0)])
def test_surfaces_at_a_grazing_angle_return_nothing(angle, lost):
    slope = np.tan(np.radians(angle))
    # A plane through a point 1 m ahead: z = 1 + slope x, x = z r.
    r = pixel_rays(DEPTH)[..., 0]
    with np.errstate(divide="ignore"):
        depth = (1.0 / (1.0 - slope * r)).astype(np.float32)
    seen = apply_depth_noise(depth, DEPTH, NO_LOSS, seed=1, frame=0)
    middle = seen[:, 158:163]
    assert np.mean(middle == 0) == pytest.approx(lost, abs=0.02)


def test_depths_are_whole_steps_of_the_disparity():
    noise = DepthNoise(floor=0.0, growth=0.0, edge_loss=0, edge_mix=0, loss=0, border=0)
    depth = flat(3.0) + np.linspace(0, 0.2, DEPTH.width, dtype=np.float32)
    seen = np.unique(apply_depth_noise(depth, DEPTH, noise, seed=1, frame=0))
    # z^2 / (16 f b), about 27 mm.
    step = 3.1**2 / (16 * DEPTH.focal_x * 0.075) * 1000
    assert np.diff(seen).mean() == pytest.approx(step, rel=0.05)


def test_dark_patches_stay_where_they_are_when_the_camera_moves():
    noise = DepthNoise(dark_fraction=0.05)

    def dark(p_WC):
        X_WC = RigidTransform(np.array(p_WC))
        return drop_dark_patches(flat(1.0), DEPTH, X_WC, noise, seed=2) == 0

    first = dark([0.0, 0.0, 0.0])
    assert np.mean(first) == pytest.approx(0.05, abs=0.03)
    # 20 columns at 1 m.
    moved = dark([20 / DEPTH.focal_x, 0.0, 0.0])
    same = moved[:, :-20] == first[:, 20:]
    assert np.mean(same) > 0.98
    sizes = cv2.connectedComponentsWithStats(first.astype(np.uint8))[2][1:, cv2.CC_STAT_AREA]
    assert 0.01 < np.sqrt(np.max(sizes)) / DEPTH.focal_x < 0.12


def test_the_blank_band_is_at_the_right_border():
    seen = apply_depth_noise(flat(1.0), DEPTH, DepthNoise(loss=0, border=5), seed=1, frame=0)
    assert not seen[:, -5:].any()
    assert seen[:, :-5].all()
