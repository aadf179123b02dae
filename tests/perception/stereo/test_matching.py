import math

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import HeadCamera, pixel_rays
from pepper_drake.perception.cameras.noise import ColorNoise, apply_color_noise
from pepper_drake.perception.cameras.texture import paint_texture
from pepper_drake.perception.stereo.matching import (
    StereoParameters,
    disparity_to_depth,
    make_stereo_cameras,
    match,
    rectify,
    rectify_images,
    rectify_pair,
)
from pepper_drake.perception.stereo.pipeline import compute_stereo_depth
from pepper_drake.perception.stereo.segmentation import SegmentationParameters

LEFT, RIGHT = make_stereo_cameras()
RECTIFICATION = rectify(LEFT, RIGHT)


def project_both(p_Head, left=LEFT, right=RIGHT):
    return [
        camera.intrinsics.project(camera.X_HeadC.inverse() @ p_Head) for camera in (left, right)
    ]


def rectified_pixels(p_Head, rectification, left):
    """Pixels of a point in the rectified left image, and its disparity, by eq. 3.3 and 3.5."""
    p_L = (left.X_HeadC @ RigidTransform(rectification.R_CLeftRect, np.zeros(3))).inverse() @ p_Head
    f, b = rectification.intrinsics.focal_x, rectification.baseline
    return rectification.intrinsics.project(p_L), f * b / p_L[2] + rectification.offset


def test_cameras_sit_beside_each_other():
    np.testing.assert_allclose(np.subtract(LEFT.p_HeadC, RIGHT.p_HeadC), [0, 0.078, 0])
    assert (LEFT.intrinsics.width, LEFT.intrinsics.height) == (1280, 720)
    wide = make_stereo_cameras(0.12)
    assert rectify(*wide).baseline == pytest.approx(0.12)


@pytest.mark.parametrize("turned", [False, True])
def test_rectified_rows_agree_and_disparity_gives_depth(turned):
    left, right = LEFT, RIGHT
    if turned:  # As it comes from the factory: the right camera a little askew.
        askew = RollPitchYaw(0.004, -0.006, 0.005)

        class Askew(HeadCamera):
            @property
            def X_HeadC(self):
                return super().X_HeadC @ RigidTransform(askew, np.zeros(3))

        right = Askew(RIGHT.name, RIGHT.intrinsics, RIGHT.p_HeadC, RIGHT.tilt)
    rectification = rectify(left, right)
    # Draw one dot in each raw image, rectify both, and find it again.
    for p_Head in ([0.8, 0.05, 0.1], [1.2, -0.2, 0.3], [0.5, 0.1, 0.0]):
        raw = []
        for u, v in project_both(np.array(p_Head), left, right):
            rows, columns = np.indices((720, 1280))
            raw.append(255 * np.exp(-((columns - u) ** 2 + (rows - v) ** 2) / 8.0))
        found = []
        for image in rectify_images(*[i.astype(np.uint8) for i in raw], rectification):
            weights = image.astype(float)
            found.append([np.average(k, weights=weights) for k in np.indices(image.shape)][::-1])
        pixel, disparity = rectified_pixels(p_Head, rectification, left)
        np.testing.assert_allclose(found[0], pixel, atol=0.05)
        assert found[0][1] == pytest.approx(found[1][1], abs=0.05)
        assert found[0][0] - found[1][0] == pytest.approx(disparity, abs=0.05)


def test_depth_is_focal_length_times_baseline_over_disparity():
    reach = RECTIFICATION.intrinsics.focal_x * RECTIFICATION.baseline
    disparity = np.array([[0, reach, 2 * reach]], np.float32) + np.float32(RECTIFICATION.offset)
    disparity[0, 0] = 0
    depth = disparity_to_depth(disparity, RECTIFICATION)
    np.testing.assert_allclose(depth, [[0, 1, 0.5]], rtol=1e-6)


@pytest.fixture(scope="module")
def wall_pair():
    """Both cameras' images of a painted wall, slightly turned, 0.8 m ahead; and the wall."""
    normal, offset = np.array([-math.cos(0.2), math.sin(0.2), 0.0]), -0.8
    images = []
    for k, camera in enumerate((LEFT, RIGHT)):
        rays = pixel_rays(camera.intrinsics.ideal()).astype(float)
        X = camera.X_HeadC
        z = (offset - normal @ X.translation()) / (rays @ (X.rotation().matrix().T @ normal))
        bare = np.full((720, 1280, 4), 190, np.uint8)
        painted = paint_texture(bare, z, camera.intrinsics, X)
        images.append(
            apply_color_noise(painted, camera.intrinsics, ColorNoise(2.0), seed=0, frame=k)[..., 0]
        )
    return images, normal, offset


def test_painted_wall_comes_out_where_it_is(wall_pair):
    (left, right), normal, offset = wall_pair
    aligned = rectify_images(left, right, RECTIFICATION)
    disparity = match(*aligned, RECTIFICATION, StereoParameters())
    depth = disparity_to_depth(disparity, RECTIFICATION)
    seen = depth > 0
    assert seen[:, 140:-20].mean() > 0.9
    rays = pixel_rays(RECTIFICATION.intrinsics)[seen]
    X = RECTIFICATION.rectified_pose(LEFT.X_HeadC)
    points = (rays * depth[seen][:, None]) @ X.rotation().matrix().T + X.translation()
    errors = points @ normal - offset
    # Neither nearer nor farther, and not shifted along x as the report's cloud was.
    assert abs(np.median(errors)) < 0.002
    assert np.mean(np.abs(errors) > 0.03) < 0.02
    assert disparity.max() < 16 * 8


def test_bare_walls_match_nothing():
    bare = np.full((720, 1280), 150, np.uint8)
    rng = np.random.default_rng(0)
    noisy = [np.clip(bare + rng.normal(0, 2, bare.shape), 0, 255).astype(np.uint8) for _ in "lr"]
    disparity = match(*noisy, RECTIFICATION, StereoParameters())
    assert np.mean(disparity > 0) < 0.02


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: make_stereo_cameras(0.0), "baseline"),
        (lambda: StereoParameters(nearest=2.0), "nearest"),
        (lambda: StereoParameters(block=6), "odd"),
        (
            lambda: rectify(
                LEFT, HeadCamera("x", RECTIFICATION.intrinsics.scaled(2), (0, 0, 0), 0)
            ),
            "size",
        ),
    ],
)
def test_bad_parameters_are_named(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_a_calibrated_pair_is_rectified_with_its_full_rotation():
    X_RL = RigidTransform(RollPitchYaw(0.005, -0.007, 0.006), [-0.083, 0.001, -0.0005])
    rectification = rectify_pair(LEFT.intrinsics, RIGHT.intrinsics, X_RL)
    assert rectification.baseline == pytest.approx(np.linalg.norm(X_RL.translation()))
    for p_L in ([0.1, 0.05, 0.8], [-0.3, -0.1, 1.2], [0.0, 0.1, 0.5]):
        dots = []
        for intrinsics, p in ((LEFT.intrinsics, np.array(p_L)), (RIGHT.intrinsics, X_RL @ p_L)):
            image = np.zeros((intrinsics.height, intrinsics.width), np.uint8)
            u, v = np.rint(intrinsics.project(p)).astype(int)
            image[v - 2 : v + 3, u - 2 : u + 3] = 255
            dots.append(image)
        rows = []
        for image in rectify_images(*dots, rectification):
            rows.append(np.average(np.indices(image.shape)[0], weights=image))
        # Dots are drawn at whole pixels.
        assert rows[0] == pytest.approx(rows[1], abs=1.0)


def test_left_and_right_exchanged_are_noticed(wall_pair):
    (left, right), _, _ = wall_pair
    with pytest.raises(InputError, match="exchange"):
        rectify_pair(LEFT.intrinsics, RIGHT.intrinsics, RigidTransform([0.078, 0, 0]))
    given = RECTIFICATION, RigidTransform(), [], [], StereoParameters(), SegmentationParameters()
    assert np.mean(compute_stereo_depth(left, right, *given).disparity > 0) > 0.5
    with pytest.raises(InputError, match="exchange left and right"):
        compute_stereo_depth(right, left, *given)


def test_images_of_another_size_than_the_calibration_are_refused():
    good = np.zeros((720, 1280), np.uint8)
    with pytest.raises(InputError, match="right image is 640x360"):
        rectify_images(good, good[::2, ::2], RECTIFICATION)
