from dataclasses import replace

import numpy as np
import pytest

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH, CAMERA_TOP
from pepper_drake.perception.gaze.head_aiming import P_T_NECK, camera_pose, look_at
from pepper_drake.perception.gaze.view_planning import (
    VIEW_POINTS,
    head_grid,
    next_best_view,
    surroundings,
    view_weights,
    visible,
    widest_view,
    within_possible_view,
)

P_TP = np.array([0.3, 0.1, 0.0])
NOTHING = np.zeros((0, 3))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_surroundings_lie_about_the_object_as_seen_from_the_neck(side):
    places = surroundings(P_TP, side)
    away = (P_TP - P_T_NECK)[:2] / np.linalg.norm((P_TP - P_T_NECK)[:2])
    offsets = places - P_TP
    np.testing.assert_allclose(offsets[:, :2] @ away, VIEW_POINTS[:, 0], atol=1e-12)
    np.testing.assert_allclose(offsets[:, 2], VIEW_POINTS[:, 2])
    left = offsets[:, :2] @ [-away[1], away[0]]
    np.testing.assert_allclose(left, side * VIEW_POINTS[:, 1], atol=1e-12)


def test_what_is_in_the_image_is_shown_and_what_is_beside_it_is_not():
    places = np.array([[0.8, 0.0, 0.0], [0.8, 1.0, 0.0], [-0.8, 0.0, 0.0]])
    head = look_at(CAMERA_DEPTH, places[0]).head
    assert visible(CAMERA_DEPTH, head, places).tolist() == [True, False, False]


DISTORTED = replace(CAMERA_TOP.intrinsics, distortion=(0.1, -0.05, 0.002, -0.003, 0.02))


@pytest.mark.parametrize("intrinsics", [CAMERA_DEPTH.intrinsics, DISTORTED])
def test_an_image_shows_what_the_camera_model_says_that_it_shows(intrinsics):
    camera, head = replace(CAMERA_TOP, intrinsics=intrinsics), (0.2, 0.3)
    places = np.random.default_rng(0).uniform([0.6, -1.0, -1.0], [1.5, 1.0, 0.6], (2000, 3))
    seen = intrinsics.sees(camera_pose(camera, head).inverse().multiply(places.T).T)
    assert 200 < np.count_nonzero(seen) < 1800
    np.testing.assert_array_equal(visible(camera, head, places), seen)


def test_places_count_most_on_the_hands_way_and_around_what_may_move():
    places = surroundings(P_TP, 1.0)
    alone = view_weights(places, NOTHING)
    assert alone[np.argmax(VIEW_POINTS[:, 1])] > alone[np.argmin(VIEW_POINTS[:, 1])]
    thing = places[[7]]
    weights = view_weights(places, thing)
    assert weights[7] == alone[7]
    far = np.linalg.norm(places - thing, axis=1) > 0.13
    assert np.all(weights[far] < 0.5 * alone[far])


def test_the_gaze_goes_to_what_was_not_seen_for_longest_unless_it_takes_too_long():
    places = np.array([[0.8, 0.4, 0.0], [0.8, -0.4, 0.0]])
    heads = [look_at(CAMERA_DEPTH, place).head for place in places]
    assert not visible(CAMERA_DEPTH, heads[0], places)[1]
    arguments = CAMERA_DEPTH, heads
    even = np.ones(2)
    assert next_best_view(*arguments, [1.0, 1.0], places, even, np.array([2.0, 1.0])) == 0
    assert next_best_view(*arguments, [1.0, 1.0], places, even, np.array([1.0, 2.0])) == 1
    assert next_best_view(*arguments, [1.0, 5.0], places, even, np.array([1.0, 2.0])) == 0
    assert (
        next_best_view(*arguments, [1.0, 1.0], places, np.array([9.0, 1.0]), np.array([1.0, 2.0]))
        == 0
    )


@pytest.mark.parametrize("baseline", [0.0, 0.075])
def test_a_place_can_be_seen_if_a_gaze_shows_it_and_no_sphere_is_on_the_way_to_any_eye(baseline):
    rng = np.random.default_rng(0)
    places = rng.uniform([0.2, -0.6, -0.4], [0.9, 0.6, 0.4], (25, 3))
    centers = rng.uniform([-0.2, -0.5, -0.5], [0.4, 0.5, 0.3], (12, 3))
    radii = rng.uniform(0.02, 0.09, 12)
    steps = np.linspace(0.0, 1.0, 400)[:, None, None]

    def is_free(eye, place):
        """Walks along the line of sight."""
        off = eye + steps * (place - eye) - centers
        return np.all(np.linalg.norm(off, axis=2) > radii + 0.03)

    expected = np.zeros(len(places), dtype=bool)
    for head in head_grid():
        X_TC = camera_pose(CAMERA_DEPTH, head)
        eyes = [X_TC @ np.array([x, 0.0, 0.0]) for x in {0.0, baseline, -baseline}]
        for n in np.flatnonzero(visible(CAMERA_DEPTH, head, places, border=0.15) & ~expected):
            expected[n] = all(is_free(eye, places[n]) for eye in eyes)
    margins = {"border": 0.15, "margin": 0.03}
    found = within_possible_view(CAMERA_DEPTH, places, (centers, radii), baseline, **margins)
    assert 0 < np.count_nonzero(found) < len(places)
    assert found.tolist() == expected.tolist()
    assert np.all(within_possible_view(CAMERA_DEPTH, places, **margins) >= found)


def test_the_widest_view_shows_most_places_that_nothing_occludes():
    left, right = ([[0.8, y, z] for z in (0.0, 0.05, 0.1)] for y in (0.8, -0.8))
    places = np.array([*left, *right[:2]])
    aside = np.array([[0.35, 0.4, 0.15]]), np.array([0.2])  # Between the camera and the left.

    def shown(hiding):
        p_T = widest_view(CAMERA_DEPTH, places, hiding, 0.075, border=0.15)
        return visible(CAMERA_DEPTH, look_at(CAMERA_DEPTH, p_T).head, places).tolist()

    assert shown((NOTHING, np.zeros(0))) == [True] * 3 + [False] * 2
    assert shown(aside) == [False] * 3 + [True] * 2
