import itertools
import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from pydrake.multibody.plant import MultibodyPlant

from pepper_drake.models.pepper import add_pepper, head_pitch_limits
from pepper_drake.perception.cameras.camera import CAMERA_BOTTOM, CAMERA_DEPTH, CAMERA_TOP
from pepper_drake.perception.gaze.head_aiming import (
    HEAD_YAW_LIMIT,
    P_T_NECK,
    aim_for_two_cameras,
    aim_head,
    camera_pose,
    choose_camera,
    clamp_head,
    head_search_pattern,
    image_offset,
    look_at,
    step_head_trajectory,
)

CAMERAS = (CAMERA_TOP, CAMERA_BOTTOM, CAMERA_DEPTH)
points = st.tuples(st.floats(-1.5, 2), st.floats(-1.5, 1.5), st.floats(-1, 1)).map(np.array)
heads = st.tuples(st.floats(-2, 2), st.floats(-0.7, 0.6))


@given(heads)
def test_camera_poses_are_those_of_peppers_model(head):
    plant = MultibodyPlant(0.0)
    model = add_pepper(plant)
    plant.Finalize()
    context = plant.CreateDefaultContext()
    for name, angle in zip(("HeadYaw", "HeadPitch"), head, strict=True):
        plant.GetJointByName(name, model).set_angle(context, angle)
    torso = plant.GetFrameByName("torso")
    for camera in CAMERAS:
        X_TC = plant.GetFrameByName(camera.frame_name).CalcPose(context, torso)
        assert camera_pose(camera, head).IsNearlyEqualTo(X_TC, 1e-5)


@given(points, st.sampled_from(CAMERAS))
def test_aiming_puts_the_point_on_the_optical_axis(p_TP, camera):
    offset = p_TP - P_T_NECK
    assume(np.linalg.norm(offset) > 0.3 and math.hypot(*offset[:2]) > 0.1)
    p_CP = camera_pose(camera, aim_head(camera, p_TP)).inverse() @ p_TP
    np.testing.assert_allclose(p_CP[:2], 0, atol=1e-9)
    assert p_CP[2] > 0


@given(points, heads, st.sampled_from(CAMERAS))
def test_image_offset_is_that_of_the_projection(p_TP, head, camera):
    p_CP = camera_pose(camera, head).inverse() @ p_TP
    assume(abs(p_CP[2]) > 1e-3)
    size = np.array([camera.intrinsics.width, camera.intrinsics.height])
    if p_CP[2] > 0:
        from_middle = camera.intrinsics.ideal().project(p_CP) - (size - 1) / 2
        expected = np.max(np.abs(from_middle) / (size / 2))
    else:
        expected = np.inf
    assert image_offset(camera, head, p_TP) == pytest.approx(expected, rel=1e-6)


@given(heads)
def test_clamped_head_is_within_the_coupled_limits(head):
    yaw, pitch = clamp_head(np.multiply(head, 3))
    lower, upper = head_pitch_limits(yaw)
    assert abs(yaw) <= HEAD_YAW_LIMIT
    assert lower <= pitch <= upper


def test_head_looks_up_at_what_is_behind_as_far_as_it_can():
    gaze = look_at(CAMERA_TOP, [-1.0, 0.01, 0.2])
    assert not gaze.in_view
    assert gaze.head[0] == HEAD_YAW_LIMIT


def test_near_and_low_is_for_the_bottom_camera_far_for_the_top_one():
    near = choose_camera((CAMERA_TOP, CAMERA_BOTTOM), [0.30, -0.15, -0.1])
    far = choose_camera((CAMERA_TOP, CAMERA_BOTTOM), [1.2, 0.1, 0.0])
    assert (near.camera, far.camera) == (CAMERA_BOTTOM, CAMERA_TOP)
    assert near.in_view
    assert far.in_view


def test_choice_does_not_flicker():
    pair = (CAMERA_TOP, CAMERA_BOTTOM)
    line = np.linspace(0.9, 0.25, 60)

    def walk(distances, current):
        chosen = []
        for x in distances:
            current = choose_camera(pair, [x, -0.1, -0.1], current=current).camera
            chosen.append(current.name)
        return chosen

    closer = walk(line, CAMERA_TOP)
    away = walk(line[::-1], CAMERA_BOTTOM)
    changes = [sum(a != b for a, b in itertools.pairwise(c)) for c in (closer, away)]
    assert changes == [1, 1]
    # The way back changes at another place than the way there.
    assert closer.index("CameraBottom") > len(line) - 1 - away.index("CameraTop")


PAIR = (CAMERA_TOP, CAMERA_BOTTOM)
MARKER = 0.042


@pytest.mark.parametrize("p_TP", [[0.28, -0.13, 0.0], [0.3, 0.1, -0.1], [0.6, -0.2, 0.0]])
def test_the_other_camera_sees_more_and_the_thing_stays_in_view(p_TP):
    shared = aim_for_two_cameras(PAIR, CAMERA_DEPTH, p_TP, radius=MARKER)
    alone = choose_camera(PAIR, p_TP)
    before = image_offset(CAMERA_DEPTH, alone.head, p_TP)
    assert image_offset(CAMERA_DEPTH, shared.head, p_TP) < before
    X_TC = camera_pose(shared.camera, shared.head)
    corners = MARKER * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
    middle = X_TC.inverse() @ np.array(p_TP)
    assert np.all(shared.camera.intrinsics.ideal().sees(middle + corners))


def test_a_far_thing_is_in_the_middle_for_the_other_camera():
    p_TP = [1.2, 0.1, 0.0]
    shared = aim_for_two_cameras(PAIR, CAMERA_DEPTH, p_TP, radius=MARKER)
    np.testing.assert_allclose(shared.head, look_at(CAMERA_DEPTH, p_TP).head)
    assert shared.camera is CAMERA_TOP


def test_what_no_camera_gets_into_its_image_is_looked_at_alone():
    p_TP = [0.25, 0.0, -0.1]
    shared = aim_for_two_cameras(PAIR, CAMERA_DEPTH, p_TP, radius=0.5)
    np.testing.assert_array_equal(shared.head, choose_camera(PAIR, p_TP).head)


@pytest.mark.parametrize("seed", range(5))
def test_head_arrives_within_its_limits_and_stays(seed):
    rng = np.random.default_rng(seed)
    start, target = (clamp_head(rng.uniform([-2, -0.7], [2, 0.6])) for _ in range(2))
    max_velocity, max_acceleration, dt = rng.uniform(0.5, 3), rng.uniform(2, 10), 0.02
    head, velocity = start, np.zeros(2)
    for _ in range(500):
        last_head, last_velocity = head, velocity
        head, velocity = step_head_trajectory(
            head,
            velocity,
            target,
            dt,
            max_velocity=max_velocity,
            max_acceleration=max_acceleration,
        )
        assert np.all(np.abs(velocity[0]) <= max_velocity + 1e-9)
        np.testing.assert_allclose(clamp_head(head), head)
        np.testing.assert_allclose(head - last_head, velocity * dt, atol=1e-12)
        # Yaw has fixed limits, so nothing but its target ever brakes it.
        assert abs(velocity[0] - last_velocity[0]) <= max_acceleration * dt + 1e-9
    np.testing.assert_allclose(head, target, atol=1e-6)
    np.testing.assert_allclose(velocity, 0, atol=1e-6)


@pytest.mark.parametrize(("was_seen", "found"), [(True, True), (False, False)])
def test_the_search_for_a_near_object_finds_it_between_both_images(was_seen, found):
    """At 0.4 m the images of the two cameras do not overlap by as much as a marker."""
    half = 0.03 * np.array([[0, y, z] for y in (-1, 1) for z in (-1, 1)])
    marker = [0.4, -0.05, 0.05] + half
    seen = []
    for time in np.arange(0.0, 4.2, 0.1):  # The first views, before those of higher places.
        head = head_search_pattern(time, -1.0, was_seen)
        for camera in (CAMERA_TOP, CAMERA_BOTTOM):
            p_CM = (camera_pose(camera, head).inverse() @ marker.T).T
            seen.append(camera.intrinsics.sees(p_CM).all())
    assert any(seen) == found


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_search_rests_at_views_that_overlap_from_side_to_side(side):
    times = np.arange(0, 12.7, 0.05)
    gaze = np.array([head_search_pattern(time, side) for time in times])
    np.testing.assert_allclose(gaze[times < 1.5], [[0.4 * side, 0.3]] * 30)
    assert side * gaze[np.searchsorted(times, 3.3), 0] < -0.9  # The other side comes first.
    # Three agreeing images at 5 Hz fit into each view, after 0.6 s in which the head turns there.
    turns = np.flatnonzero(np.abs(np.diff(gaze, axis=0)).max(axis=1) > 0)
    assert np.diff(times[turns]).min() >= 0.6 + 3 * 0.2
    for pitch in (0.3, -0.1):
        yaws = np.unique(gaze[gaze[:, 1] == pitch, 0])
        assert yaws[[0, -1]] == pytest.approx(np.radians([-60, 60]))
        half = np.arctan(CAMERA_TOP.intrinsics.width / 2 / CAMERA_TOP.intrinsics.focal_x)
        assert np.diff(yaws).max() < 2 * half - np.radians(15)
