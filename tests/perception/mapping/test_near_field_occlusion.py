import numpy as np
import pytest
from pydrake.geometry import Cylinder, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.mapping.depth_image_mapper import DepthImage, DepthImageMapper
from pepper_drake.perception.mapping.depth_validity import DepthFault
from pepper_drake.perception.mapping.near_field_occlusion import (
    NearFieldParameters,
    background_points,
    occluded_points,
)
from pepper_drake.perception.mapping.obstacle_map import ObstacleParameters
from pepper_drake.perception.mapping.obstacle_memory import ObstacleMemory
from pepper_drake.perception.mapping.solids import ExcludedSolids, Solid

CAMERA = CAMERA_DEPTH.intrinsics
X_WC = RigidTransform()  # Looks along +z.
NOTHING = np.zeros((0, 3))


def wall(z=1.0):
    return np.full((CAMERA.height, CAMERA.width), z, np.float32)


def holed(p_C=(0.05, 0.02, 0.3), radius=0.04):
    """A wall with the hole of a ball too near to be measured."""
    depth = wall()
    u, v = CAMERA.project(np.array(p_C))
    r = radius / p_C[2] * CAMERA.focal_x
    y, x = np.indices(depth.shape)
    depth[(x - u) ** 2 + (y - v) ** 2 < r**2] = 0
    return depth


BEHIND = background_points(NOTHING, wall(), CAMERA, X_WC)


def test_the_backdrop_is_what_is_seen():
    assert len(BEHIND) > 300
    np.testing.assert_allclose(BEHIND[:, 2], 1.0, atol=1e-6)
    # All of the image.
    assert np.ptp(BEHIND[:, 0]) == pytest.approx(CAMERA.width / CAMERA.focal_x, abs=0.05)


def test_what_a_hole_hides_stays_in_the_backdrop_and_what_has_moved_does_not():
    after = background_points(BEHIND, holed(), CAMERA, X_WC)
    assert len(after) > 0.9 * len(BEHIND)
    farther = background_points(BEHIND, wall(1.4), CAMERA, X_WC)
    np.testing.assert_allclose(farther[:, 2], 1.4, atol=1e-6)


def test_the_backdrop_stays_where_it_is_when_the_camera_turns_away():
    X_WD = RigidTransform(RollPitchYaw(0, np.pi, 0), [0, 0, 0])
    after = background_points(BEHIND, np.zeros_like(wall()), CAMERA, X_WD)
    np.testing.assert_allclose(np.sort(after[:, 0]), np.sort(BEHIND[:, 0]))


def test_a_hole_in_the_backdrop_is_of_something_near():
    points = occluded_points(BEHIND, NOTHING, holed(), CAMERA, X_WC, [])
    p_C = np.array([0.05, 0.02, 0.3])
    assert np.linalg.norm(points - p_C, axis=1).min() < 0.02
    # On the rays through the hole, nearer than what could be measured.
    assert points[:, 2].max() < CAMERA.near + 0.03
    off = points[:, :2] / points[:, 2:] - p_C[:2] / p_C[2]
    assert np.linalg.norm(off, axis=1).max() < 0.04 / 0.3 + 1e-6


@pytest.mark.parametrize(("aside", "found"), [(0.1, False), (0.5, False), (0.9, True)])
def test_what_a_moved_object_has_left_may_be_blank_where_nothing_is_behind(aside, found):
    """A person's arm that slides on uncovers the sky, which is not measured either."""
    moved = np.array([[0.05 + aside, 0.02, 1.0]])
    points = occluded_points(BEHIND, NOTHING, holed(), CAMERA, X_WC, [], moved=moved)
    assert (len(points) > 0) == found


@pytest.mark.parametrize("pitch", [0.3, 0.6, 0.8])
def test_a_hole_before_the_floor_is_of_something_near_even_beside_what_moved(pitch):
    """There the floor is seen, if it is near enough."""
    X_WC = RigidTransform(RollPitchYaw(-np.pi / 2 - pitch, 0, -np.pi / 2), [0.0, 0.0, 1.2])
    behind = background_points(NOTHING, wall(0.9), CAMERA, X_WC)
    # Beside all that is behind the hole, the floor included.
    depths = np.array([0.9, 1.2 / np.sin(pitch)])
    moved = X_WC.multiply(np.outer([0.0, 0.0, 1.0], depths)).T
    points = occluded_points(behind, NOTHING, holed((0.0, 0.0, 0.3)), CAMERA, X_WC, [], moved=moved)
    # 3 m ahead, the floor is seen from 0.41 rad downwards.
    assert (len(points) > 0) == (pitch > 0.5)


def test_without_a_hole_nothing_is_near():
    assert len(occluded_points(BEHIND, NOTHING, wall(), CAMERA, X_WC, [])) == 0


def test_single_pixels_without_a_depth_are_no_hole():
    depth = wall()
    depth[::9, ::9] = 0
    assert len(occluded_points(BEHIND, NOTHING, depth, CAMERA, X_WC, [])) == 0


def test_a_hole_where_nothing_was_known_means_nothing():
    elsewhere = BEHIND[BEHIND[:, 0] < -0.2]
    assert len(occluded_points(elsewhere, NOTHING, holed(), CAMERA, X_WC, [])) == 0


def test_before_the_floor_a_hole_means_something_wherever_nobody_looked_before():
    # A metre above the floor, looking down at it by 60 degrees.
    R_WD = RollPitchYaw(np.radians(-150), 0, 0).ToRotationMatrix()
    X_WD = RigidTransform(R_WD, [0.0, 0.0, 1.0])
    points = occluded_points(NOTHING, NOTHING, holed(), CAMERA, X_WD, [])
    assert np.linalg.norm(points - X_WD @ np.array([0.05, 0.02, 0.3]), axis=1).min() < 0.02
    # Above the horizon, and for a camera that is not above a floor, nothing is known to be behind.
    X_WU = RigidTransform(RollPitchYaw(np.radians(-30), 0, 0), [0.0, 0.0, 1.0])
    assert len(occluded_points(NOTHING, NOTHING, holed(), CAMERA, X_WU, [])) == 0
    below = RigidTransform(R_WD, [0.0, 0.0, -1.0])
    assert len(occluded_points(NOTHING, NOTHING, holed(), CAMERA, below, [])) == 0


def test_the_robot_and_known_obstacles_explain_a_hole():
    ball = Solid(Sphere(0.04), RigidTransform())
    robot = ExcludedSolids([ball], [RigidTransform([0.05, 0.02, 0.3])], 0.02)
    assert len(occluded_points(BEHIND, NOTHING, holed(), CAMERA, X_WC, [robot])) == 0
    ways = np.random.default_rng(0).normal(size=(500, 3))
    known = 0.04 * ways / np.linalg.norm(ways, axis=1)[:, None] + [0.05, 0.02, 0.3]
    assert len(occluded_points(BEHIND, known, holed(), CAMERA, X_WC, [])) == 0


def test_the_table_behind_a_hole_explains_it_only_where_the_hole_reaches_it():
    x, y = np.meshgrid(np.linspace(-0.3, 0.3, 40), np.linspace(-0.3, 0.3, 40))
    surface = np.stack([x.ravel(), y.ravel(), np.full(x.size, 0.47)], axis=1)
    # Of other things the other side is not known, and may reach as far.
    assert len(occluded_points(BEHIND, surface, holed(), CAMERA, X_WC, [])) == 0
    assert len(occluded_points(BEHIND, surface, holed(), CAMERA, X_WC, [], table=0.47)) > 0
    assert (
        len(occluded_points(BEHIND, surface - [0, 0, 0.05], holed(), CAMERA, X_WC, [], table=0.42))
        == 0
    )


def test_an_image_of_another_size_changes_nothing():
    none = np.zeros((0, 0), np.float32)
    assert len(occluded_points(BEHIND, NOTHING, none, CAMERA, X_WC, [])) == 0
    np.testing.assert_array_equal(background_points(BEHIND, none, CAMERA, X_WC), BEHIND)


def test_a_blind_image_shows_nothing_near():
    assert len(occluded_points(BEHIND, NOTHING, wall(0.0), CAMERA, X_WC, [])) == 0


@pytest.mark.parametrize(("rim", "is_explained"), [(0.045, True), (0.0, False)])
def test_what_a_near_goal_object_stands_on_explains_the_hole_that_it_leaves(rim, is_explained):
    solids = [Solid(Cylinder(0.033, 0.22), RigidTransform([0.0, 0.0, 0.11]))]
    parameters = ObstacleParameters(near_field=NearFieldParameters(support_rim=rim))
    mapper = DepthImageMapper(CAMERA, parameters, object_solids=solids)
    memory = ObstacleMemory.empty(parameters.memory)
    # A tray of 7 cm across the view, the object behind it.
    X_WO = RigidTransform([0.05, 0.02, 0.3])
    ripples = np.arange(CAMERA.width) % 40
    for k, depth in enumerate((wall(), wall(), holed(radius=0.07), holed(radius=0.07))):
        pixels = (np.round(1000 * depth + k + ripples) * (depth > 0)).astype(np.uint16)
        memory = mapper.with_image(memory, DepthImage(pixels, 0.2 * k, X_WC, X_WO))
        assert memory.fault == DepthFault.NONE
    assert (len(memory.tracker.hidden[0]) == 0) == is_explained
