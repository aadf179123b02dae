import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import (
    CAMERA_BOTTOM,
    CAMERA_DEPTH,
    CAMERA_TOP,
    CameraIntrinsics,
    distortion_maps,
    make_render_cameras,
    pixel_rays,
    ray_lengths,
)

DISTORTED = CameraIntrinsics(
    640, 480, 590.0, 600.0, 322.0, 236.0, distortion=(-0.06, 0.07, 0.001, -0.002, 0.01)
)


def test_focal_lengths_are_those_of_the_fields_of_view():
    # 598.5 and 289.7 pixels: computed by hand from 43.7 and 45 degrees.
    assert CAMERA_TOP.intrinsics.focal_y == pytest.approx(598.5, abs=0.1)
    assert CAMERA_DEPTH.intrinsics.focal_y == pytest.approx(289.7, abs=0.1)
    assert CAMERA_BOTTOM.intrinsics.center_x == 319.5


@given(
    st.lists(
        st.tuples(st.floats(-0.5, 0.5), st.floats(-0.4, 0.4), st.floats(0.2, 5)),
        min_size=1,
        max_size=5,
    )
)
def test_projection_agrees_with_opencv(directions):
    points = np.array([[x * z, y * z, z] for x, y, z in directions])
    expected, _ = cv2.projectPoints(
        points, np.zeros(3), np.zeros(3), DISTORTED.matrix, DISTORTED.distortion_coefficients
    )
    np.testing.assert_allclose(DISTORTED.project(points), expected[:, 0], atol=1e-9)


def test_points_behind_the_camera_are_not_seen():
    assert not DISTORTED.sees([0, 0, -1.0])
    assert np.isnan(DISTORTED.project([0.1, 0, 0.0])).all()


def test_margin_keeps_away_from_the_border():
    camera = CameraIntrinsics(100, 80, 50, 50, 49.5, 39.5)
    assert camera.sees([0.98, 0, 1])
    assert not camera.sees([0.98, 0, 1], margin=2)


@pytest.mark.parametrize("camera", [DISTORTED, CAMERA_DEPTH.intrinsics])
def test_rays_project_back_to_their_pixels(camera):
    rays = pixel_rays(camera, 3)
    u, v = np.meshgrid(np.arange(1, camera.width, 3), np.arange(1, camera.height, 3))
    # OpenCV undoes a distortion by iterating; a few thousandths of a pixel remain at the corners.
    np.testing.assert_allclose(camera.project(rays), np.stack([u, v], axis=-1), atol=0.02)
    np.testing.assert_allclose(ray_lengths(camera, 3)[0, 0], np.linalg.norm(rays[0, 0]), rtol=1e-6)


def test_bent_image_shows_a_dot_where_the_lens_puts_it():
    camera = CAMERA_TOP.intrinsics
    image = np.zeros((camera.height, camera.width), np.uint8)
    image[60:65, 80:85] = 255
    ray = [(82 - camera.center_x) / camera.focal_x, (62 - camera.center_y) / camera.focal_y, 1]
    bent = cv2.remap(image, *distortion_maps(camera), cv2.INTER_LINEAR).astype(float)
    v, u = (np.average(index, weights=bent) for index in np.indices(bent.shape))
    np.testing.assert_allclose([u, v], camera.project(ray), atol=0.05)
    assert np.linalg.norm(camera.project(ray) - [82, 62]) > 1


def test_renderer_gets_the_half_pixel():
    color, depth = make_render_cameras(CAMERA_DEPTH.intrinsics, "vtk")
    assert color.core().intrinsics().center_x() == 160.0
    # Nearer things are drawn, too: they keep the light of the projector away.
    assert depth.depth_range().min_depth() == 0.05
    assert depth.core().clipping().near() < 0.05


def test_more_pixels_see_the_same():
    fine = DISTORTED.scaled(3)
    middle_of_first_block = fine.project(pixel_rays(DISTORTED)[0, 0])
    np.testing.assert_allclose(middle_of_first_block, [1, 1], atol=0.06)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"width": 0}, "size"),
        ({"focal_x": -1.0}, "focal"),
        ({"near": 3.0, "far": 2.0}, "near"),
    ],
)
def test_bad_intrinsics_are_named(change, message):
    values = {
        "width": 4,
        "height": 4,
        "focal_x": 1.0,
        "focal_y": 1.0,
        "center_x": 1.5,
        "center_y": 1.5,
    } | change
    with pytest.raises(InputError, match=message):
        CameraIntrinsics(**values)


def test_bad_field_of_view_and_stride_are_named():
    with pytest.raises(InputError, match="field of view"):
        CameraIntrinsics.from_vertical_fov(10, 10, 4.0)
    with pytest.raises(InputError, match="stride"):
        pixel_rays(CAMERA_DEPTH.intrinsics, 0)
