import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.evaluation.camera_rig import CameraRig
from pepper_drake.models.scene import load_scene
from pepper_drake.perception.cameras.camera import (
    CAMERA_DEPTH,
    CAMERA_TOP,
    CameraIntrinsics,
    pixel_rays,
)

pytestmark = pytest.mark.render


@pytest.fixture(scope="module")
def rig():
    rig = CameraRig(load_scene("table"))
    rig.set_positions({"HeadYaw": -0.1, "HeadPitch": 0.3})
    return rig


def test_cameras_are_where_peppers_model_has_them(rig):
    for camera in (CAMERA_TOP, CAMERA_DEPTH):
        assert rig.pose(camera.name).IsNearlyEqualTo(rig.pose(camera.frame_name), 1e-5)


def test_depth_shows_the_true_surfaces(rig):
    # The renderer's pixels and ours agree to a tenth of a millimetre: the half-pixel rule holds.
    obstacles = rig.scene_models.obstacles
    boxes = [name for name in obstacles if name.startswith("table")]
    depth = rig.depth("CameraDepth")
    shown = rig.shows("CameraDepth", boxes) & (depth < 1.5)
    p_C = pixel_rays(CAMERA_DEPTH.intrinsics)[shown] * depth[shown][:, None]
    p_W = (rig.pose("CameraDepth") @ p_C.T.astype(float)).T
    _, distance = rig.surfaces(boxes).closest(p_W)
    assert len(distance) > 1000
    assert np.percentile(distance, 99) < 2e-4


def test_meshes_are_true_surfaces_too(rig):
    meshes = ["mug", "bottle"]
    depth = rig.depth("CameraDepth")
    shown = rig.shows("CameraDepth", meshes)
    p_C = pixel_rays(CAMERA_DEPTH.intrinsics)[shown] * depth[shown][:, None]
    p_W = (rig.pose("CameraDepth") @ p_C.T.astype(float)).T
    _, distance = rig.surfaces(meshes).closest(p_W)
    assert np.percentile(distance, 99) < 1e-3


def test_a_camera_anywhere_shows_what_it_would_on_the_head(rig):
    free = rig.color_from(CAMERA_TOP.intrinsics, rig.pose("CameraTop")).astype(int)
    on_head = rig.color("CameraTop").astype(int)
    assert np.mean(np.abs(free - on_head) > 8) < 0.01
    small = CameraIntrinsics.from_vertical_fov(64, 48, 0.8)
    X_WC = RigidTransform(RollPitchYaw(np.pi, 0, 0), [0, 0, 3.0])
    assert rig.color_from(small, X_WC).shape == (48, 64, 4)


def test_pepper_is_seen_by_its_parts(rig):
    assert {"Head", "RForeArm", "l_wrist"} <= set(rig.pepper_bodies())
    assert rig.pepper_positions().shape == (18,)
