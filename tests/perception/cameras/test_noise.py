import numpy as np
import pytest

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH, CAMERA_TOP
from pepper_drake.perception.cameras.noise import (
    ColorNoise,
    DepthNoise,
    degrade_color,
    degrade_depth,
)

DEPTH = CAMERA_DEPTH.intrinsics
COLOR = CAMERA_TOP.intrinsics
NO_LOSS = DepthNoise(edge_loss=0, edge_mix=0, loss=0)


def flat(depth):
    return np.full((DEPTH.height, DEPTH.width), depth, np.float32)


@pytest.mark.parametrize("depth", [0.5, 1.0, 3.0])
def test_depth_noise_grows_as_stated(depth):
    error = degrade_depth(flat(depth), DEPTH, NO_LOSS, seed=1, frame=0) / 1000 - depth
    # 0.0012 + 0.0019 (z - 0.4)^2; rounding to millimetres adds 0.3 mm.
    expected = np.hypot(0.0012 + 0.0019 * (depth - 0.4) ** 2, 0.0003)
    assert error.std() == pytest.approx(expected, rel=0.05)
    assert abs(error.mean()) < expected / 20


def test_depth_is_whole_millimetres_within_range():
    depth = flat(1.0)
    depth[:10], depth[10:20], depth[20:30], depth[30:40] = 0.3, 9.0, np.inf, np.nan
    seen = degrade_depth(depth, DEPTH, NO_LOSS, seed=1, frame=0)
    assert seen.dtype == np.uint16
    assert not seen[:40].any()
    assert (seen[40:] > 900).all()


def test_edges_lose_pixels_and_mix_surfaces():
    depth = flat(2.0)
    depth[:, 160:] = 1.0
    seen = degrade_depth(depth, DEPTH, DepthNoise(loss=0), seed=1, frame=0) / 1000
    edge, inside = seen[:, 158:162], seen[:, :150]
    assert 0.15 < np.mean(edge == 0) < 0.4  # Half of the two columns at the edge.
    assert np.any((edge > 1.2) & (edge < 1.8))
    assert np.all(inside > 1.9)


def test_noise_is_a_function_of_seed_and_frame():
    def see(seed, frame):
        return degrade_depth(flat(1.0), DEPTH, DepthNoise(), seed=seed, frame=frame)

    np.testing.assert_array_equal(see(3, 5), see(3, 5))
    assert np.mean(see(3, 5) == see(3, 6)) < 0.5
    assert np.mean(see(3, 5) == see(4, 5)) < 0.5


def test_colour_noise_spares_the_alpha_channel():
    image = np.full((COLOR.height, COLOR.width, 4), 128, np.uint8)
    seen = degrade_color(image, COLOR.ideal(), ColorNoise(sigma=4.0), seed=0, frame=2)
    assert seen[..., :3].std() == pytest.approx(4.0, rel=0.05)
    assert (seen[..., 3] == 128).all()
    np.testing.assert_array_equal(
        degrade_color(image, COLOR.ideal(), ColorNoise(sigma=0.0), seed=0, frame=0), image
    )


def test_saturated_colours_stay_saturated():
    image = np.full((COLOR.height, COLOR.width, 4), 255, np.uint8)
    seen = degrade_color(image, COLOR, ColorNoise(), seed=0, frame=0)
    assert seen[..., :3].min() > 200  # Not wrapped around to black.


def test_finer_images_are_averaged():
    fine = np.zeros((2 * COLOR.height, 2 * COLOR.width, 4), np.uint8)
    fine[::2] = 200
    seen = degrade_color(fine, COLOR.ideal(), ColorNoise(sigma=0.0), seed=0, frame=0)
    assert seen.shape == (COLOR.height, COLOR.width, 4)
    assert (seen == 100).all()
