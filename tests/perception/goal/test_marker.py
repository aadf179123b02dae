import cv2
import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import CAMERA_TOP
from pepper_drake.perception.cameras.images import to_gray
from pepper_drake.perception.goal.marker import (
    MarkerPose,
    choose_pose,
    detect_markers,
    marker_corners,
    marker_poses,
    refine_poses,
)

CAMERA = CAMERA_TOP.intrinsics.ideal()


def corners_of(X_CM, size=0.06):
    return CAMERA.project((X_CM @ marker_corners(size).T).T)


@pytest.mark.parametrize(("tilt", "azimuth", "roll"), [(0, 0, 0), (0.6, 1.0, 0.3), (0.8, 4.0, 2.0)])
def test_corners_of_a_drawn_marker_are_found(draw_marker, facing, tilt, azimuth, roll):
    X_CM = facing([0.05, -0.03, 0.5], tilt, azimuth, roll)
    (found,) = detect_markers(draw_marker(X_CM, CAMERA))
    assert found.id == 7
    np.testing.assert_allclose(found.corners, corners_of(X_CM), atol=0.35)


def test_window_gives_the_same_corners_as_the_whole_image(draw_marker, facing):
    X_CM = facing([0.05, -0.03, 0.5], 0.5)
    image = draw_marker(X_CM, CAMERA)
    u, v = CAMERA.project(X_CM.translation()).astype(int)
    (whole,) = detect_markers(image)
    (part,) = detect_markers(image, window=(u - 90, v - 90, u + 90, v + 90))
    np.testing.assert_allclose(part.corners, whole.corners, atol=0.15)
    assert detect_markers(image, window=(0, 0, 100, 100)) == []
    assert detect_markers(image, window=(630, 470, 900, 900)) == []


def test_nothing_is_found_in_nothing():
    assert detect_markers(np.zeros((0, 0, 4), np.uint8)) == []
    assert detect_markers(np.full((480, 640), 90, np.uint8)) == []


def test_markers_too_small_to_trust_are_left_out(draw_marker, facing):
    assert detect_markers(draw_marker(facing([0, 0, 4.0]), CAMERA)) == []


def test_exact_corners_give_the_exact_pose(facing):
    X_CM = facing([0.1, 0.05, 0.7], 0.7, 2.0, 1.0)
    best = marker_poses(corners_of(X_CM), 0.06, CAMERA)[0]
    assert best.X_CM.IsNearlyEqualTo(X_CM, 1e-5)
    assert best.reprojection_error < 1e-4


def test_distortion_is_undone(facing):
    camera = CAMERA_TOP.intrinsics
    X_CM = facing([0.3, 0.2, 0.8], 0.5, 1.0)
    corners = camera.project((X_CM @ marker_corners(0.06).T).T)
    assert marker_poses(corners, 0.06, camera)[0].X_CM.IsNearlyEqualTo(X_CM, 1e-4)


def test_both_poses_of_a_flat_square_are_kept(facing):
    X_CM = facing([0, 0, 1.2], 0.4)
    best, other = marker_poses(corners_of(X_CM), 0.06, CAMERA)
    assert best.X_CM.IsNearlyEqualTo(X_CM, 1e-3)
    assert other.reprojection_error < 1.0
    # The mirror image about the line of sight.
    turn = other.X_CM.rotation().InvertAndCompose(X_CM.rotation()).ToAngleAxis().angle()
    assert turn == pytest.approx(0.8, abs=0.1)


def test_covariance_foretells_the_scatter(facing):
    X_CM = facing([0.05, 0.0, 0.8], 0.6)
    rng = np.random.default_rng(0)
    poses = [
        marker_poses(corners_of(X_CM) + rng.normal(0, 0.2, (4, 2)), 0.06, CAMERA)[0]
        for _ in range(200)
    ]
    scatter = np.std([pose.X_CM.translation() for pose in poses], axis=0)
    foretold = np.sqrt(np.diag(poses[0].covariance)[3:])
    np.testing.assert_allclose(scatter, foretold, rtol=0.3)


@pytest.mark.parametrize("offset", [0.0, 1e-9])
@pytest.mark.parametrize("across", [0.0, 60.0])
def test_a_marker_that_faces_the_camera_squarely_has_its_pose(across, offset):
    camera = CAMERA_TOP.intrinsics.ideal()
    centre = np.array([camera.center_x + across, camera.center_y])
    corners = centre + 48.0 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    corners[0, 0] += offset
    pose = marker_poses(corners, 0.06, camera)[0]
    distance = camera.focal_x * 0.06 / 96
    expected = [across * distance / camera.focal_x, 0.0, distance]
    np.testing.assert_allclose(pose.X_CM.translation(), expected, atol=1e-6)
    np.testing.assert_allclose(pose.X_CM.rotation().matrix(), np.diag([1.0, -1.0, -1.0]), atol=1e-3)


def test_what_is_no_square_has_no_pose():
    kite = np.array([[100.0, 100], [200, 90], [160, 220], [150, 120]])
    assert marker_poses(kite, 0.06, CAMERA) == []


def two_poses(error, other_error, on_edges=False):
    upright = RotationMatrix(RollPitchYaw(np.pi / 2, 0, 0))
    leaning = RotationMatrix(RollPitchYaw(np.pi / 2 + 0.7, 0, 0))
    return [
        MarkerPose(RigidTransform(leaning, [0, 0, 1]), error, np.eye(6), on_edges),
        MarkerPose(RigidTransform(upright, [0, 0, 1]), other_error, np.eye(6), on_edges),
    ]


X_OM = RigidTransform(RollPitchYaw(np.pi / 2, 0, 0), [0, 0, 0])


def test_a_clearly_smaller_error_decides():
    poses = two_poses(0.1, 0.5)
    assert choose_pose(poses, RigidTransform(), X_OM) is poses[0]
    poses = two_poses(0.10, 0.14, on_edges=True)
    assert choose_pose(poses, RigidTransform(), X_OM) is poses[0]


def test_an_upright_object_decides_between_like_errors():
    poses = two_poses(0.10, 0.12)
    assert choose_pose(poses, RigidTransform(), X_OM) is poses[1]


def test_continuity_decides_before_uprightness():
    poses = two_poses(0.10, 0.12)
    R_WO = (poses[0].X_CM @ X_OM.inverse()).rotation()
    assert choose_pose(poses, RigidTransform(), X_OM, R_WO_last=R_WO) is poses[0]


def test_no_pose_is_chosen_from_none():
    assert choose_pose([], RigidTransform(), X_OM) is None
    poses = two_poses(0.1, 0.1)[:1]
    assert choose_pose(poses, RigidTransform(), X_OM) is poses[0]


def test_edges_bring_the_pose_closer(draw_marker, facing):
    errors = {"corners": [], "edges": []}
    rng = np.random.default_rng(2)
    for _ in range(8):
        X_CM = facing([0.03, -0.02, 0.8], rng.uniform(0.1, 0.8), *rng.uniform(0, 6, 2))
        image = draw_marker(X_CM, CAMERA)
        image = np.clip(image + rng.normal(0, 3, image.shape), 0, 255).astype(np.uint8)
        (found,) = detect_markers(image)
        poses = marker_poses(found.corners, 0.06, CAMERA)
        refined = refine_poses(image, poses, 7, 0.06, CAMERA)
        for name, pose in (("corners", poses[0]), ("edges", refined[0])):
            errors[name].append(np.linalg.norm(pose.X_CM.translation() - X_CM.translation()))
    assert np.median(errors["edges"]) < 0.5 * np.median(errors["corners"])
    assert max(errors["edges"]) < 0.003


def test_another_marker_in_the_same_place_is_not_refined(draw_marker, facing):
    X_CM = facing([0, 0, 0.5], 0.3)
    image = draw_marker(X_CM, CAMERA, marker_id=12)
    (found,) = detect_markers(image)
    poses = marker_poses(found.corners, 0.06, CAMERA)
    assert refine_poses(image, poses, 7, 0.06, CAMERA) == []
    assert refine_poses(image, poses, 12, 0.06, CAMERA)


def test_grey_of_every_layout():
    rgb = np.zeros((4, 6, 3), np.uint8)
    rgb[...] = (255, 0, 0)
    expected = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
    np.testing.assert_array_equal(to_gray(rgb), expected)
    np.testing.assert_array_equal(to_gray(cv2.cvtColor(rgb, cv2.COLOR_RGB2RGBA)), expected)
    np.testing.assert_array_equal(to_gray(expected[..., None]), expected)
    assert to_gray(expected) is expected


def test_bad_dictionary_and_size_are_named():
    with pytest.raises(InputError, match="DICT_NONE"):
        detect_markers(np.zeros((50, 50), np.uint8), dictionary="DICT_NONE")
    with pytest.raises(InputError, match="size"):
        marker_corners(0.0)
