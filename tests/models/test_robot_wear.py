import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from pepper_drake.models.robot_wear import HEAD_CAMERAS, RobotWear, WearSizes


@given(seed=st.integers(0, 2**31))
def test_no_error_is_larger_than_the_largest(seed):
    sizes, wear = WearSizes(), RobotWear.draw(seed)
    assert np.abs(wear.encoder_offset).max() <= sizes.encoder_offset
    assert np.abs(wear.odometry).max() <= sizes.odometry
    assert wear.command_latency == sizes.command_latency
    assert set(wear.cameras) == set(HEAD_CAMERAS)
    for camera in wear.cameras.values():
        assert np.linalg.norm(camera.position) <= sizes.camera_position + 1e-12
        assert np.linalg.norm(camera.rotation) <= sizes.camera_angle + 1e-12
        assert abs(camera.focal - 1) <= sizes.focal + 1e-12


def test_the_seed_says_which_robot_it_is():
    first, again, other = RobotWear.draw(4), RobotWear.draw(4), RobotWear.draw(5)
    np.testing.assert_array_equal(first.encoder_offset, again.encoder_offset)
    assert first.cameras == again.cameras
    assert not np.allclose(first.encoder_offset, other.encoder_offset)


def test_a_calibration_leaves_what_it_did_not_find():
    wear = RobotWear.draw(4)
    left = wear.calibrated(wear.encoder_offset - 0.001)
    np.testing.assert_allclose(left.encoder_offset, 0.001)
    assert left.cameras == wear.cameras


@example(direction=0.5 * np.pi, turn=0.6, slack=(-0.5, 0.5))
@given(
    direction=st.floats(0.0, np.pi),
    turn=st.floats(0.0, 0.6),
    slack=st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5)),
)
def test_two_views_disagree_by_no_more_than_the_pointing_error(direction, turn, slack):
    """A camera that is misaligned as much as it may be, on a neck whose pitch has slack."""
    sizes = WearSizes()
    misaligned = sizes.camera_angle * np.array([np.sin(direction), np.cos(direction), 0.0])
    errors = []
    for angle, side in zip((0.0, turn), slack, strict=True):
        assumed = Rotation.from_rotvec([0.0, angle, 0.0])
        true = Rotation.from_rotvec([0.0, angle + side * sizes.backlash, 0.0])
        errors.append(true * Rotation.from_rotvec(misaligned) * assumed.inv())
    disagreement = (errors[1] * errors[0].inv()).magnitude()
    assert disagreement <= 1.001 * sizes.pointing_error
