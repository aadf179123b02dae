import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH, pixel_rays
from pepper_drake.perception.mapping.cloud import depth_in_metres
from pepper_drake.perception.mapping.depth_validity import (
    FAULT_SENTENCES,
    DepthFault,
    ValidityParameters,
    depth_fault,
    image_fault,
)

CAMERA = CAMERA_DEPTH.intrinsics
SHAPE = (CAMERA.height, CAMERA.width)
PARAMETERS = ValidityParameters()
# 1.2 m above the floor, 40 degrees down: a table top 0.7 m high, and the floor before it.
X_WC = RigidTransform(RollPitchYaw(-np.pi / 2 - 0.7, 0, -np.pi / 2), [0.0, 0.0, 1.2])


def scene(X=X_WC, edge=0.6, top=0.7):
    """True depths [m]: floor, and from x = edge on a table top."""
    rays = pixel_rays(CAMERA) @ X.rotation().matrix().T
    p = X.translation()
    z = np.full(SHAPE, np.inf)
    for height in (0.0, top):
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (height - p[2]) / rays[..., 2]
            hit = (t > CAMERA.near) & (t < 4.0)
            if height > 0:
                hit &= (p[0] + t * rays[..., 0] > edge) & (p[0] + t * rays[..., 0] < 1.6)
        z = np.where(hit & (t < z), t, z)
    return np.where(np.isfinite(z), z, 0.0).astype(np.float32)


def points(depth, X=X_WC):
    """Points of a map of the scene, without the floor (P, 3) [m]."""
    z = depth[::3, ::3]
    p_W = (pixel_rays(CAMERA)[::3, ::3] * z[..., None])[z > 0] @ X.rotation().matrix().T
    p_W = p_W + X.translation()
    return p_W[p_W[:, 2] > 0.05]


def millimetres(depth, seed=0):
    noise = np.random.default_rng(seed).normal(0, 0.002, SHAPE)
    return np.where(depth > 0, np.rint(1000 * (depth + noise)), 0).astype(np.uint16)


def single(image, last=None, moved=False, parameters=PARAMETERS):
    return image_fault(image, last, CAMERA, moved=moved, parameters=parameters)


def test_every_fault_has_a_sentence():
    assert set(FAULT_SENTENCES) == set(DepthFault)


def test_two_noisy_images_of_a_scene_at_rest_are_good():
    one, other = millimetres(scene(), 1), millimetres(scene(), 2)
    assert single(other, one) == DepthFault.NONE
    assert depth_fault(scene(), X_WC, points(scene()), CAMERA, PARAMETERS) == DepthFault.NONE


@pytest.mark.parametrize(
    ("image", "fault"),
    [
        (np.zeros((0, 0), np.uint16), DepthFault.MISSING),
        (np.zeros((0, 0, 1), np.uint16), DepthFault.MISSING),
        (np.ones((120, 160), np.uint16), DepthFault.WRONG_SIZE),
        (np.ones((*SHAPE, 3), np.uint16), DepthFault.WRONG_SIZE),
        (np.zeros(SHAPE, np.uint16), DepthFault.NONE),
        (np.full(SHAPE, 65535, np.uint16), DepthFault.NONE),
        (np.full(SHAPE, 500, np.uint16), DepthFault.CONSTANT),
        (np.full((*SHAPE, 1), 500, np.uint16), DepthFault.CONSTANT),
        (np.full(SHAPE, np.nan, np.float32), DepthFault.NONE),
    ],
)
def test_images_that_are_none_by_themselves(image, fault):
    assert single(image) == fault


def test_the_same_bits_again_are_of_a_camera_that_hangs():
    image = millimetres(scene())
    assert single(image, image.copy()) == DepthFault.FROZEN
    floating = np.where(image > 0, image * 0.001, np.nan)
    assert single(floating, floating.copy()) == DepthFault.FROZEN
    quiet = ValidityParameters(expects_noise=False)
    assert single(image, image, parameters=quiet) == DepthFault.NONE
    assert single(image, image, moved=True, parameters=quiet) == DepthFault.FROZEN
    changed = image.copy()
    changed[7, 9] += 1
    assert single(changed, image) == DepthFault.NONE


@pytest.mark.parametrize("share", [0.05, 1.0])
def test_random_numbers_are_noise_even_if_most_are_out_of_range(share):
    rng = np.random.default_rng(5)
    numbers = rng.uniform(CAMERA.near, 6.0, SHAPE).astype(np.float32)
    numbers[rng.random(SHAPE) > share] = 0.0
    nothing = np.zeros((0, 3))
    assert depth_fault(numbers, X_WC, nothing, CAMERA, PARAMETERS) == DepthFault.NOISE


def test_exchanged_bytes_are_noise():
    exchanged = depth_in_metres(millimetres(scene()).byteswap(), CAMERA)
    nothing = np.zeros((0, 3))
    assert depth_fault(exchanged, X_WC, nothing, CAMERA, PARAMETERS) == DepthFault.NOISE


def test_an_image_with_noise_on_its_surfaces_or_of_fences_is_not_noise():
    rng = np.random.default_rng(6)
    rough = (scene() * rng.normal(1.0, 0.03, SHAPE)).astype(np.float32)
    known = points(scene())
    assert depth_fault(rough, X_WC, known, CAMERA, PARAMETERS) == DepthFault.NONE
    # Bars, upright or level: of the pairs of neighbours across them up to half have an edge.
    for pitch in (4, 8, 12):
        for bars in (
            (slice(None), slice(None, None, pitch)),
            (slice(None, None, pitch), slice(None)),
        ):
            fence = scene()
            fence[bars] *= 0.5
            assert depth_fault(fence, X_WC, known, CAMERA, PARAMETERS) == DepthFault.NONE
    few = np.zeros(SHAPE, np.float32)
    few[::20, ::3] = rng.uniform(CAMERA.near, 6.0, few[::20, ::3].shape)
    shows_little = ValidityParameters(shows_all=False, min_points=2000)
    assert depth_fault(few, UP, known, CAMERA, shows_little) == DepthFault.NONE


UP = RigidTransform(RollPitchYaw(-np.pi / 2 + 0.3, 0, -np.pi / 2), [0.0, 0.0, 1.2])
NOTHING = np.zeros(SHAPE, np.float32)


def test_nothing_is_blank_where_something_is_known_to_be():
    assert depth_fault(NOTHING, X_WC, points(scene()), CAMERA, PARAMETERS) == DepthFault.BLANK
    # The floor is known to be there before anything was seen.
    assert depth_fault(NOTHING, X_WC, np.zeros((0, 3)), CAMERA, PARAMETERS) == DepthFault.BLANK
    # The upper side of a thing before a camera that looks up.
    above = np.random.default_rng(0).uniform([0.8, -0.2, 1.3], [0.9, 0.2, 1.6], (200, 3))
    assert depth_fault(NOTHING, UP, above, CAMERA, PARAMETERS) == DepthFault.BLANK
    # A few pixels of noise make no image.
    speckled = NOTHING.copy()
    speckled[::60, ::60] = 0.7
    assert depth_fault(speckled, X_WC, points(scene()), CAMERA, PARAMETERS) == DepthFault.BLANK


def test_before_an_empty_hall_nothing_is_right():
    assert depth_fault(NOTHING, UP, points(scene()), CAMERA, PARAMETERS) == DepthFault.NONE
    blank = np.zeros(SHAPE, np.uint16)
    assert single(blank, blank) == DepthFault.NONE


def test_a_camera_that_shows_only_things_may_show_none():
    things = ValidityParameters(shows_all=False)
    assert depth_fault(NOTHING, X_WC, points(scene()), CAMERA, things) == DepthFault.NONE


@given(scale=st.floats(0.5, 2.0))
def test_a_wrong_scale_contradicts_the_known_table(scale):
    depth = scene()
    fault = depth_fault((scale * depth).astype(np.float32), X_WC, points(depth), CAMERA, PARAMETERS)
    # From 7 % on: nothing else moves all of a scene by the same factor.
    if 0.93 < scale < 1.07:
        assert fault == DepthFault.NONE
    if scale < 0.91 or scale > 1.1:
        assert fault in (DepthFault.CONTRADICTS_MAP, DepthFault.BELOW_FLOOR)


def test_an_image_of_another_view_contradicts_the_known_table():
    turned = X_WC @ RigidTransform(RollPitchYaw(0.0, 0.0, 0.6), [0.0, 0.0, 0.0])
    mirrored = scene(turned)[:, ::-1]
    known = points(scene(turned), turned)
    assert depth_fault(mirrored, turned, known, CAMERA, PARAMETERS) == DepthFault.CONTRADICTS_MAP


def test_a_thing_that_comes_before_most_of_the_view_contradicts_nothing():
    depth = scene()
    rng = np.random.default_rng(3)
    depth[:, 40:300] = 0.5 + 0.1 * rng.random((CAMERA.height, 260))
    assert depth_fault(depth, X_WC, points(scene()), CAMERA, PARAMETERS) == DepthFault.NONE


def test_a_thing_that_was_taken_away_contradicts_nothing():
    before, after = scene(edge=0.6), scene(edge=0.9)
    known = points(before)
    assert depth_fault(after, X_WC, known, CAMERA, PARAMETERS) == DepthFault.NONE


def test_a_camera_that_is_a_little_off_contradicts_nothing():
    off = RigidTransform(RollPitchYaw(np.radians(1.0), np.radians(1.0), 0.0), [0.005, 0, 0]) @ X_WC
    fault = depth_fault(scene(), off, points(scene()), CAMERA, PARAMETERS)
    assert fault == DepthFault.NONE


@pytest.mark.parametrize("off", [-0.05, 0.05])
def test_a_base_that_slipped_gives_no_wrong_scale(off):
    """Things are nearer or farther then by the same distance, not by the same factor."""
    slipped = RigidTransform([-off, 0.0, 0.0]) @ X_WC
    fault = depth_fault(scene(slipped), X_WC, points(scene()), CAMERA, PARAMETERS)
    assert fault == DepthFault.NONE


def test_little_that_is_known_tells_nothing():
    few = points(scene())[:50]
    assert depth_fault(1.04 * scene(), X_WC, few, CAMERA, PARAMETERS) == DepthFault.NONE
