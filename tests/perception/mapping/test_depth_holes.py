import cv2
import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.perception.mapping.depth_holes import (
    HoleMemory,
    blank_pixels,
    border_band,
    learn_blindness,
    learn_dropouts,
)
from tests.perception.mapping.wall_images import CAMERA, COLUMNS, ROWS, SHAPE, disc, wall

HOME = RigidTransform()  # Looks along +z at a wall.
EVERYWHERE = (COLUMNS[3::6, 3::6].ravel(), ROWS[3::6, 3::6].ravel())


def turned(yaw, p=(0.0, 0.0, 0.0)):
    return RigidTransform(RollPitchYaw(0, yaw, 0), np.array(p))


@pytest.mark.parametrize("side", ["left", "right", "top", "bottom"])
@pytest.mark.parametrize("width", [1, 4, 9])
def test_bands_along_the_border_are_found(side, width):
    measured = np.ones(SHAPE, dtype=bool)
    across = slice(None, width) if side in ("left", "top") else slice(-width, None)
    part = (slice(None), across) if side in ("left", "right") else (across, slice(None))
    measured[part] = False
    band = border_band(measured)
    assert band[part].all()
    assert band.sum() <= (width + 1) / width * (~measured).sum()


def test_ragged_bands_are_found_and_things_at_the_border_are_none():
    rng = np.random.default_rng(0)
    measured = np.ones(SHAPE, dtype=bool)
    for row, width in enumerate(rng.integers(5, 11, CAMERA.height)):
        measured[row, CAMERA.width - width :] = False
    assert np.mean(border_band(measured)[~measured]) > 0.95
    # An arm that comes in from the side.
    arm = np.ones(SHAPE, dtype=bool)
    arm[90:150, 180:] = False
    assert not border_band(arm).any()
    # Beside a band it is no part of it but for the band's own width.
    both = arm & measured
    band = border_band(both)
    assert not band[100:140, 180:300].any()


def test_an_empty_sky_is_no_band():
    measured = np.ones(SHAPE, dtype=bool)
    measured[:60] = False
    assert not border_band(measured).any()


def look(memory, depth, X_WC):
    return learn_blindness(memory, depth, EVERYWHERE, CAMERA, X_WC)


def spot():
    depth = wall()
    cv2.ellipse(depth, (160, 150), (14, 9), 0, 0, 360, 0.0, -1)
    return depth


def test_pixels_that_stay_blank_while_the_camera_turns_are_blind():
    memory = HoleMemory.empty()
    for k in range(4):
        memory = look(memory, spot(), turned(0.1 * k))
    assert memory.blind_pixels()[150, 160]
    assert not blank_pixels(spot(), memory.blind_pixels()).any()
    # Once they measure, they never count as blind again.
    memory = look(memory, wall(), turned(0.5))
    assert not memory.blind_pixels().any()


def test_a_camera_that_stands_learns_no_blind_pixels():
    memory = HoleMemory.empty()
    for _ in range(10):
        memory = look(memory, spot(), HOME)
    assert not memory.blind_pixels().any()


def test_a_thing_before_a_camera_that_turns_is_no_blind_pixel():
    p_WB = np.array([0.0, 0.0, 0.3])
    memory = HoleMemory.empty()
    for yaw in np.linspace(-0.25, 0.25, 11):
        X_WC = turned(yaw)
        depth = wall()
        depth[disc(X_WC.inverse() @ p_WB, 0.05)] = 0
        memory = look(memory, depth, X_WC)
        assert not memory.blind_pixels().any()


def test_an_arm_that_covers_most_of_the_image_is_no_blind_pixel_until_the_camera_has_moved_far():
    depth = wall()
    depth[60:, 100:] = 0
    memory = HoleMemory.empty()
    for yaw in np.linspace(0.0, 0.5, 6):
        memory = look(memory, depth, turned(yaw))
    assert not memory.blind_pixels()[100:200, 150:250].any()


def explained(memory, depth, X_WC):
    return learn_dropouts(memory, depth, blank_pixels(depth), CAMERA, X_WC)


def test_small_closed_holes_are_of_the_surface():
    depth = wall()
    depth[100:112, 150:162] = 0
    _, mask = explained(HoleMemory.empty(), depth, HOME)
    np.testing.assert_array_equal(mask, blank_pixels(depth))


def test_larger_ones_are_not_until_the_camera_has_moved():
    """A patch of 10 cm on a wall, and a ball before it, seen from places beside one another."""
    memory, found = HoleMemory.empty(), []
    for x in (0.0, 0.03, 0.06, 0.09, 0.12):
        X_WC = RigidTransform([x, 0.0, 0.0])
        depth = wall()
        depth[disc(X_WC.inverse() @ np.array([0.05, 0.0, 1.2]), 0.05)] = 0
        memory, mask = explained(memory, depth, X_WC)
        found.append(mask.any())
    assert not found[0]
    assert found[-1]


def test_a_ball_before_the_wall_is_never_of_the_surface():
    memory = HoleMemory.empty()
    for x in np.linspace(0.0, 0.15, 8):
        X_WC = RigidTransform([x, 0.0, 0.0])
        depth = wall()
        depth[disc(X_WC.inverse() @ np.array([0.05, 0.0, 0.3]), 0.04)] = 0
        memory, mask = explained(memory, depth, X_WC)
        assert not mask.any()


def test_what_is_measured_again_is_forgotten():
    memory = HoleMemory.empty()
    depth = wall()
    depth[disc((0.05, 0.0, 1.2), 0.05)] = 0
    memory, _ = explained(memory, depth, HOME)
    assert len(memory.places) > 5
    memory, _ = explained(memory, wall(), HOME)
    assert len(memory.places) == 0


def test_holes_that_are_open_or_not_on_a_plane_are_not_followed():
    open_hole = wall()
    open_hole[100:200, 250:] = 0
    memory, mask = explained(HoleMemory.empty(), open_hole, HOME)
    assert len(memory.places) == 0
    assert not mask.any()
    step = wall()
    step[:, 160:] = 0.7
    step[100:140, 140:180] = 0
    memory, mask = explained(HoleMemory.empty(), step, HOME)
    assert len(memory.places) == 0
    assert not mask.any()


def test_images_of_another_size_begin_anew():
    memory = look(HoleMemory.empty(), wall(), HOME)
    other = memory.for_image_size(120, 160)
    assert other.measured.shape == (120, 160)
    assert not other.measured.any()
    assert memory.for_image_size(*SHAPE) is memory
