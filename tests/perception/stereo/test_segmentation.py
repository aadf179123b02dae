import numpy as np
import pytest
from pydrake.geometry import Box, Capsule, Cylinder, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.perception.cameras.camera import CameraIntrinsics, pixel_rays
from pepper_drake.perception.mapping.solids import Solid
from pepper_drake.perception.stereo.segmentation import (
    SegmentationParameters,
    body_mask,
    segment_disparity,
)

CAMERA = CameraIntrinsics.from_vertical_fov(320, 240, 0.9)
PARAMETERS = SegmentationParameters()


def table_with_two_things():
    """Disparities of a lying plane with two standing things on it, and their image."""
    rows, columns = np.indices((240, 320))
    disparity = np.where(rows > 120, 20 + 0.2 * (rows - 120), 0).astype(np.float32)
    image = np.full((240, 320, 3), 60, np.uint8)
    image[rows > 120] = (90, 120, 160)
    for left, foot, color in ((60, 180, (200, 40, 40)), (200, 200, (40, 200, 40))):
        thing = (columns >= left) & (columns < left + 40) & (rows > 90) & (rows < foot)
        disparity[thing] = 20 + 0.2 * (foot - 120)
        image[thing] = color
    return disparity, image


def test_things_on_a_table_are_told_from_it_and_from_each_other():
    disparity, image = table_with_two_things()
    labels = segment_disparity(disparity, image, PARAMETERS)
    first, second, table = labels[140, 80], labels[140, 220], labels[220, 130]
    assert len({0, first, second, table}) == 4
    assert np.mean(labels[100:170, 65:95] == first) > 0.95
    assert np.mean(labels[100:190, 205:235] == second) > 0.95
    assert not labels[:60].any()


def test_specks_and_nothing_are_no_things():
    disparity = np.zeros((240, 320), np.float32)
    image = np.zeros((240, 320, 3), np.uint8)
    assert not segment_disparity(disparity, image, PARAMETERS).any()
    disparity[100:108, 100:108] = 30
    assert not segment_disparity(disparity, image, PARAMETERS).any()


@pytest.mark.parametrize(
    "shape", [Box(0.2, 0.1, 0.15), Cylinder(0.06, 0.2), Sphere(0.1), Capsule(0.05, 0.1)]
)
def test_mask_is_the_silhouette(shape):
    solid = Solid(shape, RigidTransform(RollPitchYaw(0.4, 0.3, 0.2), [0.02, 0.05, 0.0]))
    X_WC, X_WF = RigidTransform([0, 0, -0.1]), RigidTransform([0.05, -0.05, 0.6])
    mask = body_mask([solid], [X_WF], X_WC, CAMERA, margin=0.0)
    # By brute force: the rays that come inside the solid anywhere.
    rays = pixel_rays(CAMERA, 4).reshape(-1, 3).astype(float)
    steps = np.linspace(0.3, 1.1, 400)
    X_SW = (X_WF @ solid.X_FS).inverse()
    points = X_WC.translation() + steps[:, None, None] * rays
    p_S = (X_SW @ points.reshape(-1, 3).T).T
    hit = (solid.signed_distance(p_S).reshape(len(steps), -1).min(axis=0) <= 0).reshape(60, 80)
    seen = mask[2::4, 2::4]
    assert np.mean(seen[hit]) == 1.0  # Nothing of it is missed, ...
    assert np.sum(seen & ~hit) < 0.12 * np.sum(hit)  # ... and not much else taken.
    assert body_mask([solid], [X_WF], X_WC, CAMERA, margin=0.03).sum() > 1.2 * mask.sum()


def test_solid_that_reaches_behind_the_camera_is_cut_off():
    arm = Solid(Capsule(0.04, 0.8), RigidTransform(RollPitchYaw(0.2, 0, 0), [0.0, 0.15, 0.0]))
    mask = body_mask([arm], [RigidTransform()], RigidTransform(), CAMERA, 0.0)
    assert 0.02 < mask.mean() < 0.6
    assert mask[-1].any()
    assert not mask[:60].any()


def test_what_is_behind_or_holds_the_camera_masks_nothing():
    behind = Solid(Sphere(0.1), RigidTransform([0, 0, -1.0]))
    head = Solid(Sphere(0.2), RigidTransform([0, 0, -0.1]))
    poses = [RigidTransform()] * 2
    assert not body_mask([behind, head], poses, RigidTransform(), CAMERA, 0.01).any()
