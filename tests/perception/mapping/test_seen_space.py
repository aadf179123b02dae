import copy

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.mapping.dynamic_obstacles import DepthFrame
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters, update_obstacles
from pepper_drake.perception.mapping.seen_space import SeenSpace, SpaceState, describe_place
from pepper_drake.perception.mapping.voxel_map import VoxelMap

CAMERA = CAMERA_DEPTH.intrinsics
HOME = RigidTransform([0.0, 0.0, 1.0])  # Looks up along +z, from above the floor.
AWAY = HOME @ RigidTransform(RollPitchYaw(0, np.pi / 2, 0), [0, 0, 0])
FREE, OCCUPIED, UNKNOWN = SpaceState.FREE, SpaceState.OCCUPIED, SpaceState.UNKNOWN


def image(board=True):
    """A wall 1.2 m away with a board 0.8 m away before its left half, and a hole."""
    depth = np.full((CAMERA.height, CAMERA.width), 1.2, np.float32)
    if board:
        depth[:, :160] = 0.8
    depth[100:140, 250:290] = 0
    return depth


def seen(*frames):
    space, voxels = SeenSpace(VoxelMap.empty()), VoxelMap.empty()
    for depth, time, X_WC in frames:
        view = DepthFrame(depth, X_WC, time, CAMERA)
        voxels = update_obstacles(voxels, depth, time, X_WC, CAMERA, [], ObstacleParameters())
        space = space.with_view(view, voxels)
    return space


def at(column, row, z):
    """A place in W on a pixel's ray at a depth."""
    ray = [(column - CAMERA.center_x) / CAMERA.focal_x, (row - CAMERA.center_y) / CAMERA.focal_y, 1]
    return HOME @ (z * np.array(ray))


PLACES = {
    "before the board": (at(80, 120, 0.6), FREE),
    "on the board": (at(80, 120, 0.8), OCCUPIED),
    "just before it": (at(80, 120, 0.785), OCCUPIED),
    "behind it": (at(80, 120, 1.0), UNKNOWN),
    "before the wall": (at(220, 60, 1.0), FREE),
    "nearer than the near limit": (at(220, 60, 0.2), FREE),
    "in the hole": (at(270, 120, 1.0), UNKNOWN),
    "beyond the wall": (at(220, 60, 1.5), UNKNOWN),
    "behind the camera": (HOME @ np.array([0, 0, -0.5]), UNKNOWN),
    "beside the image": (HOME @ np.array([2.0, 0, 1.0]), UNKNOWN),
}


@pytest.mark.parametrize("name", PLACES)
def test_places_are_free_occupied_or_unknown(name):
    place, expected = PLACES[name]
    state, age = seen((image(), 1.0, HOME)).states(place[None], 1.5)
    assert state[0] == expected
    assert age[0] == (np.inf if expected == UNKNOWN else pytest.approx(0.5))


def test_all_at_once_are_as_one_by_one():
    space = seen((image(), 1.0, HOME))
    places = np.array([place for place, _ in PLACES.values()])
    state, _ = space.states(places, 2.0)
    np.testing.assert_array_equal(state, [expected for _, expected in PLACES.values()])
    assert space.states(np.zeros((0, 3)), 2.0)[0].shape == (0,)


def test_before_the_first_image_all_is_unknown():
    space = SeenSpace(VoxelMap.empty())
    state, age = space.states(np.zeros((3, 3)), 0.0)
    assert (state == UNKNOWN).all()
    assert np.isinf(age).all()


def test_what_was_seen_stays_known_with_its_age_while_the_camera_looks_elsewhere():
    space = seen((image(), 1.0, HOME), (image(board=False), 3.0, AWAY))
    state, age = space.states(np.array([PLACES["before the board"][0]]), 4.0)
    assert state[0] == FREE
    assert age[0] == pytest.approx(3.0)
    assert space.unseen(PLACES["before the board"][0], 4.0, oldest=2.0).all()
    assert not space.unseen(PLACES["before the board"][0], 4.0, oldest=3.5).any()


def test_the_newest_image_decides_when():
    space = seen(*((image(), 1.0 + 0.2 * k, HOME) for k in range(6)))
    assert len(space.views) == 3
    assert space.states(np.array([PLACES["before the board"][0]]), 2.1)[1][0] == pytest.approx(0.1)


def test_what_one_image_lost_another_shows():
    lost = image()
    lost[:, 200:240] = 0
    space = seen((image(), 1.0, HOME), (lost, 1.2, HOME))
    state, age = space.states(PLACES["before the wall"][0][None], 1.3)
    assert state[0] == FREE
    assert age[0] == pytest.approx(0.3)


def test_what_came_is_occupied_though_it_was_free():
    board = at(80, 120, 0.8)
    before = seen((image(board=False), 1.0, HOME))
    assert before.states(board[None], 1.1)[0][0] == FREE
    after = seen((image(board=False), 1.0, HOME), (image(), 1.2, HOME))
    assert after.states(board[None], 1.3)[0][0] == OCCUPIED
    # Behind it is what was looked through before: the age tells when.
    assert after.states(at(80, 120, 1.0)[None], 1.3)[1][0] == pytest.approx(0.3)


def test_occupied_places_are_never_unseen():
    space = seen((image(), 1.0, HOME))
    assert not space.unseen(PLACES["on the board"][0], 1000.0, oldest=1.0).any()
    assert space.unseen(PLACES["behind it"][0], 1.0, oldest=1.0).all()


def test_the_number_of_views_is_bounded():
    frames = [
        (image(), 0.2 * k, HOME @ RigidTransform(RollPitchYaw(0, 0.16 * k, 0), [0, 0, 0]))
        for k in range(40)
    ]
    space = seen(*frames)
    assert len(space.views) <= 32
    assert space.views[-1].time == pytest.approx(39 * 0.2)
    assert copy.deepcopy(space) is space


def test_places_are_described_from_where_the_robot_stands():
    words = describe_place(np.array([0.421, -0.1, -0.05]))
    assert words == "0.42 m ahead, 0.10 m to the right, 0.05 m below the torso's middle"


def test_below_what_was_seen_is_unknown_down_to_where_an_image_looked_through():
    # The camera looks down at a floor from 1 m, with a board 0.6 m below it on one side.
    above = RigidTransform(RollPitchYaw(np.pi, 0, 0), [0.0, 0.0, 1.0])
    depth = np.full((CAMERA.height, CAMERA.width), 1.0, np.float32)
    depth[:, :160] = 0.6
    space = seen((depth, 1.0, above))
    board = space.voxels.positions[space.voxels.positions[:, 2] > 0.2]
    hidden = space.hidden_below(board[:100], 0.03)
    assert hidden[:, 2].min() < 0.03
    assert hidden[:, 2].max() < 0.4
    assert space.unseen(hidden, 1.0, oldest=np.inf).all()
    # Another image from the side, along y, looks through 0.2 m above the floor.
    sideways = RollPitchYaw(-np.pi / 2, 0, 0).ToRotationMatrix()
    middle = board[np.argmin(np.linalg.norm(board[:, :2], axis=1))]
    aside = RigidTransform(sideways, [middle[0], middle[1] - 0.8, 0.2])
    wall = np.full((CAMERA.height, CAMERA.width), 3.0, np.float32)
    seen_below = space.with_view(DepthFrame(wall, aside, 1.1, CAMERA), space.voxels)
    below = seen_below.hidden_below(middle, 0.03)
    assert len(below) < len(space.hidden_below(middle, 0.03))
    assert below[:, 2].min(initial=1.0) > 0.2


def test_nothing_is_below_nothing():
    assert seen((image(), 1.0, HOME)).hidden_below(np.zeros((0, 3)), 0.03).shape == (0, 3)


def looking_down(depth):
    """Space that was seen by a camera 1.2 m high that looks down."""
    return seen((depth, 1.0, RigidTransform(RollPitchYaw(np.pi, 0, 0), [0.0, 0.0, 1.2])))


TABLE = np.full((CAMERA.height, CAMERA.width), 0.9, np.float32)
"""A table 0.3 m high."""


def column(space, beside=0.0, above=0.0):
    """Points of a thing 0.2 m high on the table, beside its middle, or above it."""
    table = space.voxels.positions[space.voxels.positions[:, 2] < 0.4]
    foot = table[np.argmin(np.linalg.norm(table[:, :2] - [0.2, 0.0], axis=1))]
    return foot + np.array([[0.0, beside, above + 0.03 + 0.01 * k] for k in range(20)])


def test_things_with_free_space_below_hang_in_the_air():
    space = looking_down(TABLE)
    standing, floating = column(space), column(space, beside=0.1, above=0.2)
    below = space.states(floating - [0.0, 0.0, 0.05], 1.0)[0]
    assert (below == FREE).all()
    places = np.concatenate((standing, floating))
    hangs = space.hanging(places, 0.03, 0.05, 10, 0.2)
    np.testing.assert_array_equal(hangs, [False] * 20 + [True] * 20)
    assert not space.hanging(places, 0.03, 0.05, 21, 0.2).any()
    assert space.hanging(np.zeros((0, 3)), 0.03, 0.05, 10, 0.2).shape == (0,)


@pytest.mark.parametrize(("share", "hangs"), [(0.2, True), (0.35, False)])
def test_some_of_the_space_below_a_hanging_thing_may_be_hidden(share, hangs):
    depth = TABLE.copy()
    depth[:, :160] = 0.6  # A board on one side.
    space = looking_down(depth)
    board = space.voxels.positions[space.voxels.positions[:, 2] > 0.5]
    board = board[np.argsort(np.linalg.norm(board - board.mean(axis=0), axis=1))[:40]]
    hidden = space.states(board - [0.0, 0.0, 0.05], 1.0)[0]
    assert (hidden == UNKNOWN).all()
    assert not space.hanging(board, 0.03, 0.05, 10, 0.2).any()
    # Another part of the same thing, over space that was looked through.
    line = np.linspace(board[0], board[0] + [0.5, 0.0, 0.0], 60)
    seen_below = (space.states(line - [0.0, 0.0, 0.05], 1.0)[0] == FREE).mean()
    few = line[: round(60 * (1.0 - seen_below) / 0.7)]
    assert 0.25 < (space.states(few - [0.0, 0.0, 0.05], 1.0)[0] == FREE).mean() < 0.33
    assert space.hanging(few, 0.03, 0.05, 10, share).all() == hangs


@pytest.mark.parametrize("turned", [0.0, 0.6])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_end_of_a_thing_is_hidden_where_nobody_looked_through_the_space_beyond(turned, side):
    depth = TABLE.copy()
    depth[:, 120:200] = 0.45  # A board above the middle hides what is below it.
    space = looking_down(depth)
    rod = np.linspace([0.0, 0.0, 0.0], [0.1, 0.0, 0.0], 20)
    rod = (RigidTransform(RollPitchYaw(0.0, 0.0, turned), [0.0, 0.0, 0.5]) @ rod.T).T
    rod[:, 0] -= rod[-1, 0] if side < 0.0 else 0.0
    edges = np.linspace(0.0, 0.3, 301)[:, None] * [side, 0.0, 0.0] + [0.0, 0.0, 0.5]
    free = space.states(edges, 1.0)[0] == FREE
    edge = np.argmax(free) * 0.001  # Where the board's shadow ends.
    assert 0.05 < edge < 0.15
    in_view, near = (rod + [side * (edge + gap), 0.0, 0.0] for gap in (0.06, 0.02))
    assert (space.states(near, 1.0)[0] == FREE).all()
    assert not space.end_hidden(in_view, 0.03, 0.05).any()
    assert space.end_hidden(near, 0.03, 0.05).all()
    assert not space.end_hidden(near, 0.03, 0.01).any()
    both = np.concatenate((in_view + [0.0, 0.0, 0.1], near))
    np.testing.assert_array_equal(space.end_hidden(both, 0.03, 0.05), [False] * 20 + [True] * 20)
    assert space.end_hidden(np.zeros((0, 3)), 0.03, 0.05).shape == (0,)
