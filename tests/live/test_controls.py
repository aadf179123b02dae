import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from pydrake.geometry import Box, Capsule, Cylinder, Ellipsoid, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.live.controls import (
    HAND_LOWER,
    HAND_UPPER,
    KEYS,
    MOVES,
    TURNS,
    clamped_offset,
    clamped_place,
    stepped,
    within_reach,
)
from pepper_drake.live.drawing import cloud_colors
from pepper_drake.live.robot_drawing import triangles_of

X = RigidTransform(RollPitchYaw(0.3, -0.2, 1.0), [0.1, -0.2, 0.05])
RIGHT, AHEAD = np.array([0.0, 1.0, 0.0]), np.array([-1.0, 0.0, 0.0])  # Seen from before Pepper.


def test_every_key_is_named_once():
    assert len(set(KEYS)) == len(KEYS)


def test_arrows_move_the_hand_as_it_is_seen():
    moved = stepped(X, "ArrowRight", RIGHT, AHEAD).translation() - X.translation()
    np.testing.assert_allclose(moved, [0, 0.005, 0], atol=1e-12)
    moved = stepped(X, "ArrowUp", RIGHT, AHEAD).translation() - X.translation()
    np.testing.assert_allclose(moved, [-0.005, 0, 0], atol=1e-12)


def test_each_key_has_one_that_takes_it_back():
    for keys in (MOVES, TURNS):
        names = list(keys)
        for one, other in zip(names[::2], names[1::2], strict=True):
            back = stepped(stepped(X, one, RIGHT, AHEAD), other, RIGHT, AHEAD)
            assert back.IsNearlyEqualTo(X, 1e-9)


@given(st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=3))
def test_nothing_leaves_its_box(position):
    place = np.array(position)
    hand = within_reach(RigidTransform(place)).translation()
    assert np.all((hand >= HAND_LOWER) & (hand <= HAND_UPPER))
    assert np.abs(clamped_offset(place)).max() <= 0.2
    assert clamped_place(place)[2] > 0.0


def test_shapes_are_drawn_with_their_size():
    for shape, size in (
        (Box(0.1, 0.2, 0.3), [0.1, 0.2, 0.3]),
        (Sphere(0.1), [0.2, 0.2, 0.2]),
        (Cylinder(0.1, 0.5), [0.2, 0.2, 0.5]),
        (Capsule(0.1, 0.5), [0.2, 0.2, 0.7]),
        (Ellipsoid(0.1, 0.2, 0.3), [0.2, 0.4, 0.6]),
    ):
        mesh = triangles_of(shape)
        np.testing.assert_allclose(mesh.bounds[1] - mesh.bounds[0], size, rtol=0.02)
        np.testing.assert_allclose(mesh.bounds.mean(axis=0), 0, atol=1e-3)


def test_a_cloud_is_red_when_near_and_blue_when_far():
    near, _, far = cloud_colors(np.array([0.0, 0.15, 5.0])).astype(int)
    assert near[0] > near[2] + 100
    assert far[2] > far[0] + 50
