import cv2
import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.errors import InputError
from pepper_drake.models.scene import load_scene
from pepper_drake.perception.cameras.camera import CAMERA_TOP
from pepper_drake.perception.cameras.noise import ColorNoise, apply_color_noise
from pepper_drake.perception.goal.detection import MarkedObject, detect_goal
from pepper_drake.perception.goal.imm_filter import GoalFilterParameters, GoalState, update_goal
from pepper_drake.perception.mapping.solids import near_solids

CAMERA = CAMERA_TOP.intrinsics
X_OM = RigidTransform(RollPitchYaw(np.pi / 2, 0, 0), [0.0, -0.04, 0.1])
MARKED = MarkedObject(7, 0.06, X_OM)
# A camera 1 m above the floor that looks along +x, 20 degrees down.
X_WC = RigidTransform(RollPitchYaw(-np.pi / 2 - 0.35, 0, -np.pi / 2), [0.0, 0.0, 1.0])


def photograph(draw_marker, X_CM, frame=0, noise=3.0, **options):
    """A drawn marker through the real camera's lens and with its noise."""
    image = draw_marker(X_CM, CAMERA.ideal(), **options)
    rgba = cv2.cvtColor(image, cv2.COLOR_GRAY2RGBA)
    return apply_color_noise(rgba, CAMERA, ColorNoise(noise), seed=1, frame=frame)


def measure(image, **options):
    return detect_goal(image, 0.0, X_WC, CAMERA, MARKED, **options)


def test_goal_is_where_it_was_drawn(draw_marker, facing):
    X_CM = facing([0.12, 0.08, 0.7], 0.6, 1.0)
    seen = measure(photograph(draw_marker, X_CM))
    X_WO = X_WC @ X_CM @ X_OM.inverse()
    assert np.linalg.norm(seen.p_WM - X_WC @ X_CM.translation()) < 0.002
    turn = seen.R_WO.InvertAndCompose(X_WO.rotation()).ToAngleAxis().angle()
    assert turn < 0.02
    assert seen.rotation_variance < 0.02**2


def test_expectation_finds_the_same(draw_marker, facing):
    X_CM = facing([0.12, 0.08, 0.7], 0.6, 1.0)
    image = photograph(draw_marker, X_CM)
    expected = X_WC @ X_CM.translation() + [0.01, -0.01, 0.005]
    alone, led = measure(image), measure(image, p_WM_expected=expected)
    np.testing.assert_allclose(led.p_WM, alone.p_WM, atol=0.0005)
    # An expectation that is wrong does not keep the goal from being found.
    misled = measure(image, p_WM_expected=X_WC @ np.array([-0.2, -0.1, 0.8]))
    np.testing.assert_allclose(misled.p_WM, alone.p_WM, atol=0.0005)


def test_wrong_ids_and_no_markers_are_no_goal(draw_marker, facing):
    assert measure(photograph(draw_marker, facing([0, 0, 0.6], 0.3), marker_id=12)) is None
    assert measure(np.full((480, 640, 4), 100, np.uint8)) is None
    assert measure(np.zeros((0, 0, 4), np.uint8)) is None


def test_of_two_goals_the_expected_one_counts(draw_marker, facing):
    here, there = facing([-0.1, 0, 0.6], 0.2), facing([0.12, 0.0, 0.6], 0.2)
    both = draw_marker(there, CAMERA.ideal())
    image = photograph(draw_marker, here, image=both)
    assert measure(image) is None
    # Both are within the searched window.
    expected = X_WC @ there.translation()
    seen = measure(image, p_WM_expected=expected)
    np.testing.assert_allclose(seen.p_WM, expected, atol=0.004)


def test_other_markers_do_not_disturb(draw_marker, facing):
    X_CM = facing([0.05, 0, 0.6], 0.3)
    other = draw_marker(facing([-0.12, 0.03, 0.6]), CAMERA.ideal(), marker_id=3)
    seen = measure(photograph(draw_marker, X_CM, image=other))
    np.testing.assert_allclose(seen.p_WM, X_WC @ X_CM.translation(), atol=0.003)


def spoil(image, how, rng):
    """Images as a real camera delivers them on a bad day."""
    image = image.copy()
    if how == "half hidden":
        image[:, 320:] = [*rng.integers(0, 255, 3).tolist(), 255]
    elif how == "glare":
        cv2.circle(image, (320, 240), 45, (255, 255, 255, 255), -1)
    elif how == "saturated":
        image[..., :3] = 255
    elif how == "dark":
        image[..., :3] //= 40
    elif how == "salt and pepper":
        where = rng.random(image.shape[:2]) < 0.3
        image[where, :3] = rng.choice([0, 255], (int(where.sum()), 1))
    elif how == "motion blur":
        image = cv2.blur(image, (31, 1))
    elif how == "torn":
        image[240:] = np.roll(image[240:], 25, axis=1)
    return image


@pytest.mark.parametrize(
    "how",
    ["half hidden", "glare", "saturated", "dark", "salt and pepper", "motion blur", "torn"],
)
def test_spoilt_images_give_a_right_goal_or_none(draw_marker, facing, how):
    rng = np.random.default_rng(0)
    state = GoalState()
    X_CM = facing([0.0, 0.0, 0.6], 0.3, 2.0)
    good = photograph(draw_marker, X_CM)
    for frame in range(6):
        seen = detect_goal(spoil(good, how, rng), 0.2 * frame, X_WC, CAMERA, MARKED)
        if seen is not None:
            state = update_goal(state, seen, X_OM.translation(), GoalFilterParameters())
    if state.published is not None:
        X_WO = X_WC @ X_CM @ X_OM.inverse()
        error = np.linalg.norm(state.published.translation() - X_WO.translation())
        assert error < 0.008


def test_small_blur_and_weak_light_are_borne(draw_marker, facing):
    X_CM = facing([0.0, 0.0, 0.6], 0.3, 2.0)
    image = photograph(draw_marker, X_CM, noise=1.0)
    for spoilt in (cv2.blur(image, (4, 1)), image // 4):
        seen = measure(spoilt)
        assert np.linalg.norm(seen.p_WM - X_WC @ X_CM.translation()) < 0.004


def test_half_hidden_markers_are_never_a_wrong_goal(draw_marker, facing):
    rng = np.random.default_rng(3)
    for _ in range(30):
        distance = rng.uniform(0.3, 1.2)
        X_CM = facing([0.0, 0.0, distance], *rng.uniform(0, 0.8, 2))
        image = draw_marker(X_CM, CAMERA.ideal())
        u, v = CAMERA.project(X_CM.translation()).astype(int)
        side = int(CAMERA.focal_x * 0.06 / distance)
        du, dv = rng.integers(-side, side + 1, 2) // 2
        cover = rng.integers(0, 255)
        image[v + dv : v + dv + side, u + du : u + du + side] = cover
        seen = measure(cv2.cvtColor(image, cv2.COLOR_GRAY2RGBA))
        if seen is not None:
            assert np.linalg.norm(seen.p_WM - X_WC @ X_CM.translation()) < 0.02


def test_goal_objects_solids_are_its_cylinder_and_plate():
    goal = load_scene("table").goal
    marked = MarkedObject.from_scene(goal)
    X_WO = goal.pose()
    on_marker = X_WO @ goal.marker.pose() @ np.array([0.035, 0.035, 0.0])
    on_cylinder = X_WO @ np.array([0, goal.radius, goal.height / 2])
    above = X_WO @ np.array([0, 0, goal.height + 0.03])
    near = near_solids(
        np.array([on_marker, on_cylinder, above]), marked.solids, [X_WO, X_WO], 0.001
    )
    np.testing.assert_array_equal(near, [True, True, False])


def test_bad_objects_are_named():
    with pytest.raises(InputError, match="id"):
        MarkedObject(-1, 0.06, X_OM)
    with pytest.raises(InputError, match="size"):
        MarkedObject(1, 0.0, X_OM)
