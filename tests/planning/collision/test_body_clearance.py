import numpy as np
import pytest

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import BODY_JOINTS, shared_control_model
from pepper_drake.models.pepper import posture_positions
from pepper_drake.planning.collision.body_clearance import (
    BodyClearance,
    body_links,
    drive_poses,
)

JOINTS = np.array([posture_positions("upright")[name] for name in BODY_JOINTS])


@pytest.fixture(scope="module")
def body():
    model = shared_control_model()
    return BodyClearance(model, body_links(model))


def field(*points):
    return PointCloudDistance(np.array(points, dtype=float), extension=0.0)


def test_a_point_before_the_tablet_is_as_far_as_it_is(body):
    # The tablet's box: centre 0.104 0 0.038 in the torso frame, 0.82 m above the floor, pitched.
    near = body(np.zeros((1, 3)), JOINTS, field([0.25, 0.0, 0.85]))[0]
    far = body(np.zeros((1, 3)), JOINTS, field([0.35, 0.0, 0.85]))[0]
    assert 0.06 < near < 0.16
    assert far - near == pytest.approx(0.1, abs=0.01)


def test_the_base_pose_moves_the_body(body):
    obstacle = field([1.0, 0.5, 0.85])
    poses = np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.0], [0.5, 0.5, np.pi]])
    clearances = body(poses, JOINTS, obstacle)
    assert clearances[1] < clearances[0]
    # Turned round, the robot has the obstacle behind its back, which is flatter.
    assert clearances[2] > clearances[1]
    local = body(np.zeros((1, 3)), JOINTS, field([0.5, 0.0, 0.85]))[0]
    assert clearances[1] == pytest.approx(local, abs=1e-6)


def test_an_arm_that_is_watched_by_itself_is_left_out():
    model = shared_control_model()
    without = BodyClearance(model, body_links(model, without_arm="right"))
    whole = BodyClearance(model, body_links(model))
    beside_hand = field([0.0, -0.35, 0.6])
    assert whole(np.zeros((1, 3)), JOINTS, beside_hand)[0] < 0.14
    assert without(np.zeros((1, 3)), JOINTS, beside_hand)[0] > 0.16


def test_a_drive_is_looked_at_all_the_way_and_turns_the_short_way():
    poses = drive_poses(np.array([0.0, 0.0, 3.0]), np.array([1.0, 0.0, -3.0]))
    np.testing.assert_allclose(poses[0], [0, 0, 3])
    np.testing.assert_allclose(poses[-1], [1, 0, 2 * np.pi - 3])
    assert np.hypot(*np.diff(poses[:, :2], axis=0).T).max() <= 0.03 + 1e-9
    only_turn = drive_poses(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    assert np.abs(np.diff(only_turn[:, 2])).max() <= 0.09 + 1e-9
