import numpy as np
import pytest
from pydrake.geometry import Sphere
from pydrake.math import RigidTransform

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.mapping.cloud import depth_in_metres
from pepper_drake.perception.mapping.depth_image_mapper import DepthImage, DepthImageMapper
from pepper_drake.perception.mapping.dynamic_obstacle_tracker import (
    DynamicObstacleTracker,
    reset_while_driving,
    update_tracker,
    without_object,
)
from pepper_drake.perception.mapping.dynamic_obstacles import ApproachParameters, DepthFrame
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters, update_obstacles
from pepper_drake.perception.mapping.obstacle_memory import ObstacleMemory
from pepper_drake.perception.mapping.solids import Solid
from pepper_drake.perception.mapping.voxel_map import VoxelMap

CAMERA = CAMERA_DEPTH.intrinsics
PARAMETERS = ObstacleParameters()
X_WC = RigidTransform()  # Looks along +z.
AWAY = RigidTransform([0.0, 0.0, 2.0])


def image(millimetres=None, column=160):
    """A wall 1.4 m away with, if a distance is given, a disc before it."""
    depth = np.full((CAMERA.height, CAMERA.width), 1400, np.uint16)
    if millimetres is not None:
        y, x = np.indices(depth.shape)
        depth[(x - column) ** 2 + (y - 120) ** 2 < 25**2] = millimetres
    return depth


def shown(*frames, pointing_error=0.0):
    """State after images, each with its time and the camera's pose."""
    tracker, voxels = DynamicObstacleTracker(), VoxelMap.empty()
    for depth, time, X_WD in frames:
        voxels = update_obstacles(voxels, depth, time, X_WD, CAMERA, [], PARAMETERS)
        view = DepthFrame(depth_in_metres(depth, CAMERA), X_WD, time, CAMERA, pointing_error)
        tracker, voxels = update_tracker(tracker, voxels, view, [], PARAMETERS)
    return tracker, voxels


def is_ball_known(voxels):
    return bool(np.any(np.abs(voxels.positions[:, 2] - 0.8) < 0.02))


def test_a_scene_at_rest_has_nothing_that_moves():
    tracker, voxels = shown(*((image(800), 0.2 * k, X_WC) for k in range(4)))
    assert tracker.things == ()
    assert len(tracker.expected) == len(tracker.transient_keys) == 0
    assert is_ball_known(voxels)


def test_what_came_is_forgotten_when_it_was_not_seen_for_long():
    came = [(image(), 0.0, X_WC), (image(800), 0.2, X_WC)]
    visit = PARAMETERS.approach.transient_timeout
    tracker, voxels = shown(*came, (image(), 0.1 + visit, AWAY))
    assert is_ball_known(voxels)
    assert set(tracker.transient_keys) <= set(voxels.keys)
    assert not is_ball_known(shown(*came, (image(), 0.3 + visit, AWAY))[1])


def test_a_part_that_is_not_seen_stays_while_the_rest_of_its_thing_is_seen():
    """A bar that comes from the side; then its tip is out of the image, and its end is not."""
    visit = PARAMETERS.approach.transient_timeout
    bar = image()
    bar[110:130, 60:260] = 800
    beside = RigidTransform([0.25, 0.0, 0.0])  # Sees the bar's end at +x alone.
    rest = image()
    rest[110:130, : 260 - round(0.25 / 0.8 * CAMERA.focal_x)] = 800
    for last, known in ((rest, True), (image(), False)):
        _, voxels = shown(
            (image(), 0.0, X_WC), (bar, 0.2, X_WC), (last, 0.4, beside), (last, 0.5 + visit, beside)
        )
        tip = (voxels.positions[:, 0] < -0.2) & (np.abs(voxels.positions[:, 2] - 0.8) < 0.02)
        assert tip.any() == known


def test_what_was_there_from_the_beginning_is_never_forgotten():
    visit = PARAMETERS.approach.transient_timeout
    assert is_ball_known(shown((image(800), 0.0, X_WC), (image(), 3 * visit, AWAY))[1])


def test_what_comes_too_near_to_be_measured_moves():
    tracker, _ = shown((image(), 0.0, X_WC), (image(0), 0.2, X_WC))
    assert len(tracker.things) == 1
    assert len(tracker.expected) > 0
    assert tracker.expected[:, 2].max() < CAMERA.near + 0.04


@pytest.mark.parametrize("wall", [1000, 1100, 1400])
def test_what_comes_straight_at_the_camera_stays_known_when_it_is_too_near(wall):
    """Its last points lie in the hole: they are no reason why the wall behind them is blank."""

    def comes(millimetres, radius):
        depth = np.full((CAMERA.height, CAMERA.width), wall, np.uint16)
        y, x = np.indices(depth.shape)
        depth[(x - 160) ** 2 + (y - 120) ** 2 < radius**2] = millimetres
        return depth

    near = [(comes(z, 20000 / z), 0.2 * k, X_WC) for k, z in enumerate((800, 600, 480), start=1)]
    inside = [(comes(0, 55), 0.2 * k, X_WC) for k in range(4, 8)]
    tracker, _ = shown((comes(wall, 0), 0.0, X_WC), *near, *inside)
    assert len(tracker.hidden[0]) > 1000


def test_a_few_new_pixels_excuse_no_hole():
    speck = image()
    speck[100:104, 190:194] = 1200
    hole = speck.copy()
    hole[image(800) == 800] = 0
    frames = (image(), 0.0, X_WC), (speck, 0.2, X_WC), (hole, 0.4, X_WC)
    alone = (image(), 0.0, X_WC), (np.where(hole == 800, 1400, hole), 0.4, X_WC)
    assert len(shown(*frames)[0].hidden[0]) == len(shown(*alone)[0].hidden[0]) > 0


def test_a_blank_beside_what_came_is_what_it_left():
    """A disc comes; then it has moved on, and where it was nothing is measured."""
    left = image(800, column=220)
    left[image(800) == 800] = 0
    came = (image(), 0.0, X_WC), (image(800), 0.2, X_WC)
    tracker, _ = shown(*came, (left, 0.4, X_WC))
    assert len(tracker.hidden[0]) == 0
    # Without anything that came, it is something near.
    tracker, _ = shown(came[0], (left, 0.2, X_WC))
    assert len(tracker.hidden[0]) > 0


def test_what_came_while_the_camera_looked_elsewhere_is_known_to_have_come():
    tracker, voxels = shown((image(), 0.0, X_WC), (image(), 0.2, AWAY), (image(800), 0.4, X_WC))
    assert len(tracker.things) == 1
    visible = voxels.positions[np.isin(voxels.keys, tracker.transient_keys)]
    assert np.any(np.abs(visible[:, 2] - 0.8) < 0.02)


def test_what_a_hole_told_of_is_remembered_for_a_while():
    frames = (image(), 0.0, X_WC), (image(0), 0.2, X_WC)
    assert len(shown(*frames)[0].hidden[0]) > 0
    assert len(shown(*frames, (image(), 1.2, AWAY))[0].hidden[0]) > 0
    assert len(shown(*frames, (image(), 2.3, AWAY))[0].hidden[0]) == 0
    # Not where it is seen to have gone.
    assert len(shown(*frames, (image(), 1.2, X_WC))[0].hidden[0]) == 0


def test_what_moves_too_slowly_for_two_images_is_told_from_older_ones():
    # 3 pixels are 9 mm, less than a voxel.
    frames = [(image(800, 160 + 3 * k), 0.2 * k, X_WC) for k in range(7)]
    tracker, _ = shown(*frames)
    assert len(tracker.things) == 1
    assert tracker.things[0].velocity[0] > 0.02
    assert len(tracker.views) <= 4, "of views that show the same few are kept"


def test_what_only_seems_to_move_as_the_neck_has_slack_is_not_new():
    slack = np.radians(1.0)
    turned = round(slack * CAMERA.focal_x)
    frames = (image(800), 0.0, X_WC), (image(800, 160 + turned), 0.2, X_WC)
    assert len(shown(*frames)[0].things) == 1
    tracker, _ = shown(*frames, pointing_error=slack)
    assert tracker.things == ()
    assert len(tracker.transient_keys) == 0
    # Whoever maps images takes it from the parameters.
    parameters = ObstacleParameters(approach=ApproachParameters(pointing_error=slack))
    mapper = DepthImageMapper(CAMERA, parameters)
    memory = ObstacleMemory.empty(parameters.memory)
    for depth, time, X_WD in frames:
        memory = mapper.with_image(memory, DepthImage(depth, time, X_WD))
    assert (len(memory.tracker.views), memory.tracker.things) == (2, ())
    # What comes is as wide as a fist, more than the slack.
    assert len(shown((image(), 0.0, X_WC), frames[1], pointing_error=slack)[0].things) == 1


def test_what_was_just_outside_the_image_may_seem_to_come_as_the_neck_has_slack():
    slack = np.radians(1.0)
    view = DepthFrame(depth_in_metres(image(), CAMERA), X_WC, 0.0, CAMERA, slack)
    error = np.ceil(slack * CAMERA.focal_x)
    for edge, off, side in ((0, -0.5, 1), (CAMERA.width, 0.5, -1)):
        columns = edge + side * np.array([0.5 * error, error + 2.0]) + off
        rays = (columns - CAMERA.center_x) / CAMERA.focal_x
        places = 0.8 * np.column_stack((rays, np.zeros(2), np.ones(2)))
        free = view.sees_free_space(places, PARAMETERS.memory)
        np.testing.assert_array_equal(free, [False, True])


def test_on_the_way_only_what_is_behind_all_is_learned():
    tracker, _ = shown((image(), 0.0, X_WC), (image(800), 0.2, X_WC))
    passing = reset_while_driving(tracker, tracker.views[-1], PARAMETERS)
    assert passing.things == passing.views == ()
    assert len(passing.behind) > 0


def test_an_object_that_was_lifted_before_it_was_seen_there_has_not_come():
    disc = image(800)
    tracker, _ = shown((image(), 0.0, X_WC), (disc, 0.2, X_WC), (disc, 0.4, X_WC))
    assert tracker.things
    ball = Solid(Sphere(0.08), RigidTransform())
    there = RigidTransform([0.0, 0.0, 0.82])
    before = RigidTransform([0.0, -0.3, 0.82])
    assert without_object(tracker, [ball], [before, there], PARAMETERS).things == ()
    # What is beside the object is not it.
    assert without_object(tracker, [ball], [before, before], PARAMETERS).things == tracker.things
