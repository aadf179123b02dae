import numpy as np
import pytest

from pepper_drake.evaluation.perception_evaluation import PerceptionEvaluation
from pepper_drake.models.scene import load_scene
from pepper_drake.perception.cameras.camera import CAMERA_BOTTOM, CAMERA_TOP
from pepper_drake.perception.gaze.head_aiming import image_offset

pytestmark = pytest.mark.render


@pytest.fixture(scope="module")
def study():
    return PerceptionEvaluation(load_scene("table"), seed=1)


def test_head_looks_at_the_marker(study):
    goal = load_scene("table").goal
    p_WM = (goal.pose() @ goal.marker.pose()).translation()
    p_TM = study.rig.pose("torso").inverse() @ p_WM
    assert image_offset(CAMERA_TOP, study.head, p_TM) < 0.05


def test_depth_cloud_keeps_its_promises(study):
    depth = study.depth(frames=3)
    report = depth.report
    assert report.rms_error < 0.005
    assert max(np.abs(report.bias)) < 0.002
    assert report.coverage > 0.97
    assert report.outlier_share < 0.002
    assert (report.robot_points, report.goal_points) == (0, 0)
    assert depth.images["depth"].shape == (240, 320)
    assert report.points == len(depth.surface.positions)


def test_neither_pepper_nor_the_goal_is_an_obstacle(study):
    before = study.rig.pepper_positions()
    assert study.foreign_points(4) == (0, 0)
    np.testing.assert_allclose(study.rig.pepper_positions(), before)


@pytest.mark.parametrize("texture", ["painted", "pattern"])
def test_stereo_cloud_keeps_its_promises(study, texture):
    report = study.stereo(texture).report
    assert max(np.abs(report.bias)) < 0.005
    assert report.outlier_share < 0.02
    assert report.coverage > 0.8
    assert (report.robot_points, report.goal_points) == (0, 0)


def test_bare_surfaces_leave_a_poor_stereo_cloud(study):
    assert study.stereo("none").report.coverage < 0.5


def test_goal_is_found_by_both_cameras_from_all_sides(study):
    samples = study.goal((CAMERA_TOP, CAMERA_BOTTOM), (0.4, 0.9), count=3)
    assert len(samples) == 12
    assert {(s.camera, s.distance) for s in samples} == {
        (camera.name, distance) for camera in (CAMERA_TOP, CAMERA_BOTTOM) for distance in (0.4, 0.9)
    }
    found = [s for s in samples if s.found]
    assert len(found) >= 11
    errors = [s.position_error for s in found]
    assert np.median(errors) < 0.003
    assert max(errors) < 0.012
    assert max(s.angle for s in samples) <= np.radians(50)


def test_the_same_seed_sees_the_same():
    scene = load_scene("free")
    first, again = (PerceptionEvaluation(scene, seed=2).depth(frames=2) for _ in range(2))
    np.testing.assert_array_equal(first.surface.positions, again.surface.positions)
    other = PerceptionEvaluation(scene, seed=3).depth(frames=2)
    assert not np.array_equal(first.images["depth"], other.images["depth"])
