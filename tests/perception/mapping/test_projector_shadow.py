import numpy as np
import pytest
from pydrake.geometry import Box
from pydrake.math import RigidTransform

from pepper_drake.perception.cameras.structured_light import projector_shadow
from pepper_drake.perception.mapping.depth_holes import HoleMemory, blank_pixels
from pepper_drake.perception.mapping.near_field_occlusion import (
    background_points,
    occluded_points,
    unexplained_holes,
)
from pepper_drake.perception.mapping.projector_shadow import (
    BOTH_SIDES,
    in_measured_shadow,
    projector_sides,
)
from pepper_drake.perception.mapping.solids import ExcludedSolids, Solid
from tests.perception.mapping.wall_images import CAMERA, SHAPE, disc, places, wall

BASELINE = 0.075
X_WC = RigidTransform()  # Looks along +z at a wall.
NOTHING = np.zeros((0, 3))


@pytest.mark.parametrize("baseline", [BASELINE, -BASELINE])
@pytest.mark.parametrize("width", [8, 60])
@pytest.mark.parametrize("near", [0.45, 0.7])
def test_the_projectors_shadow_is_explained_whatever_its_side(baseline, width, near):
    depth = wall()
    depth[50:200, 150 : 150 + width] = near
    shadow = projector_shadow(depth, CAMERA, baseline)
    assert shadow.sum() > 500
    depth[shadow] = 0
    hidden = places(shadow & blank_pixels(depth))
    assert len(hidden) > 4
    assert in_measured_shadow(hidden, depth, CAMERA, BASELINE).mean() > 0.95
    side = int(np.sign(baseline))
    assert in_measured_shadow(hidden, depth, CAMERA, BASELINE, sides=(side,)).mean() > 0.95
    assert in_measured_shadow(hidden, depth, CAMERA, BASELINE, sides=(-side,)).mean() < 0.05
    assert not in_measured_shadow(hidden, depth, CAMERA, 0.0).any()


def test_the_shadow_is_explained_where_the_surface_in_it_was_never_seen():
    depth = wall(0.9)
    depth[50:200, 150:190] = 0.5
    shadow = projector_shadow(depth, CAMERA, BASELINE)
    depth[shadow] = 0
    # Of what is behind, only the floor farther away is known.
    hidden = places(shadow & blank_pixels(depth), z=1.6)
    assert in_measured_shadow(hidden, depth, CAMERA, BASELINE).mean() > 0.9


def test_a_hole_beside_a_thing_is_no_shadow_where_it_is_too_wide_for_one():
    depth = wall()
    depth[50:200, 200:260] = 0.7
    depth[100:160, 60:200] = 0
    hole = np.zeros(SHAPE, dtype=bool)
    hole[103:157, 63:180] = True
    explained = in_measured_shadow(places(hole), depth, CAMERA, BASELINE)
    # f b (1/0.7 - 1/1.2) = 13 pixels of 140.
    assert explained.mean() < 0.15


def test_a_hole_with_nothing_near_is_no_shadow():
    depth = wall()
    ball = disc((0.05, 0.02, 0.3), 0.04)
    depth[ball] = 0
    assert not in_measured_shadow(places(ball), depth, CAMERA, BASELINE).any()


BEHIND = background_points(NOTHING, wall(), CAMERA, X_WC)


def sides_after(*depths):
    memory = HoleMemory.empty()
    for depth in depths:
        memory, _ = unexplained_holes(memory, BEHIND, depth, CAMERA, X_WC, baseline=BASELINE)
    return projector_sides(memory)


def box_with_shadow(baseline, column=150):
    depth = wall()
    depth[50:200, column : column + 60] = 0.6
    depth[projector_shadow(depth, CAMERA, baseline)] = 0
    return depth


@pytest.mark.parametrize("side", BOTH_SIDES)
def test_the_projectors_side_is_learned_from_shadows(side):
    few = box_with_shadow(side * BASELINE)
    few[:175] = 1.2
    assert sides_after(few) == BOTH_SIDES
    assert sides_after(few, few) == (side,)


def test_shadows_on_both_sides_and_holes_without_an_edge_tell_no_side():
    mirrored = [box_with_shadow(side * BASELINE) for side in BOTH_SIDES]
    assert sides_after(*10 * mirrored) == BOTH_SIDES
    dark = wall()
    dark[100:140, 100:200] = 0
    assert sides_after(*20 * [dark]) == BOTH_SIDES


def test_what_a_projector_on_the_other_side_would_be_hidden_by_explains_no_hole():
    depth = wall()
    depth[disc((0.05, 0.02, 0.3), 0.04)] = 0
    # Between the ball's hole and a projector at negative x, beside the camera's own rays.
    arm = ExcludedSolids(
        [Solid(Box(0.07, 0.12, 0.02), RigidTransform())],
        [RigidTransform([-0.045, 0.0133, 0.2])],
        0.005,
    )

    def found(sides):
        return len(
            occluded_points(
                BEHIND, NOTHING, depth, CAMERA, X_WC, [arm], baseline=BASELINE, sides=sides
            )
        )

    assert found(BOTH_SIDES) == found((-1,)) == 0
    assert found((1,)) > 100


def test_the_shadow_of_what_is_outside_the_image_is_explained():
    depth = wall()
    depth[100:140, 280:310] = 0
    # Farther than the near limit, and to the right of what the camera sees.
    right = places(depth == 0).max(axis=0)
    p_CO = np.array([BASELINE, 0.0, 0.0])
    p_CA = p_CO + (right - p_CO) * (0.6 / 1.2)
    arm = ExcludedSolids([Solid(Box(0.2, 0.3, 0.04), RigidTransform())], [RigidTransform(p_CA)], 0)

    y, x = (axis.ravel() for axis in np.mgrid[-0.15:0.15:0.02, -0.1:0.1:0.02])
    board = p_CA + np.column_stack((x, y, np.zeros(len(x))))

    def found(known, ignored):
        return len(
            occluded_points(
                BEHIND, known, depth, CAMERA, X_WC, ignored, baseline=BASELINE, sides=(1,)
            )
        )

    assert found(NOTHING, []) > 100
    assert found(NOTHING, [arm]) == 0
    assert found(board, []) == 0
    # What is in the image would be measured.
    assert found(board - [0.3, 0.0, 0.0], []) > 100
