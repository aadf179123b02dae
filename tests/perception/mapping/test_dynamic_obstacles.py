import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.mapping.dynamic_obstacles import (
    ApproachParameters,
    DepthFrame,
    NewPoints,
    TrackedObstacle,
    associate,
    estimate_velocity,
    predict_occupancy,
)
from pepper_drake.perception.mapping.voxel_map import VoxelMapParameters

CAMERA = CAMERA_DEPTH.intrinsics
MEMORY = VoxelMapParameters()
PARAMETERS = ApproachParameters()
X_WC = RigidTransform()  # Looks along +z, x to the right.
PERIOD = 0.2
NOTHING = np.zeros((0, 3))


def front(points, left=NOTHING, since=0.0, normals=None):
    """A new obstacle whose shape tells nothing unless normals are given."""
    return NewPoints(points, np.zeros_like(points) if normals is None else normals, left, since)


def plate(middle, half=0.05, z=1.0):
    """Points of a square plate across the camera's axis, and the depth image of it on a wall."""
    side = np.arange(-half, half + 1e-9, 0.01)
    x, y = np.meshgrid(middle + side, side)
    points = np.stack([x.ravel(), y.ravel(), np.full(x.size, z)], axis=1)
    depth = np.full((CAMERA.height, CAMERA.width), 1.5, np.float32)
    (left, top), (right, bottom) = np.rint(CAMERA.project(points[[0, -1]])).astype(int)
    depth[max(top, 0) : bottom + 1, max(left, 0) : max(right + 1, 0)] = z
    return points, depth


def come(points, before):
    """Those of some points that are where an image looked through."""
    return front(points[before.sees_free_space(points, MEMORY)], since=before.time)


def watch(middles, things=()):
    """Shows a plate at one place after the other."""
    before = None
    for number, middle in enumerate(middles):
        points, depth = plate(middle)
        now = DepthFrame(depth, X_WC, PERIOD * number, CAMERA)
        if before is not None:
            things = associate(things, come(points, before), now, MEMORY, PARAMETERS)
        before = now
    return things, now


def soon(things, now, veil=NOTHING):
    return predict_occupancy(things, veil, now, MEMORY, PARAMETERS)


def test_what_stands_still_is_not_followed():
    assert watch([0.1, 0.1, 0.1])[0] == ()


def test_what_moves_is_followed_with_its_velocity():
    (thing,), now = watch(np.arange(5) * 0.05)
    assert thing.seen == pytest.approx(now.time)
    np.testing.assert_allclose(thing.velocity, [0.25, 0.0, 0.0], atol=0.02)
    # Only its front came to where nothing was.
    assert thing.points[:, 0].min() > 0.2
    assert thing.points[:, 0].max() <= 0.251


def test_it_is_expected_as_far_ahead_as_it_may_come():
    things, now = watch(np.arange(5) * 0.05)
    ahead = soon(things, now)[:, 0]
    assert ahead.max() == pytest.approx(0.25 + 0.25 * PARAMETERS.horizon, abs=0.03)
    # No gap is left on the way.
    assert np.diff(np.sort(ahead)).max() < 2 * PARAMETERS.spacing


def test_what_is_seen_once_goes_on_from_the_rest_of_what_it_belongs_to():
    tip = plate(0.1)[0]
    arm = np.concatenate([plate(middle)[0] for middle in (-0.2, -0.1, 0.0, 0.1)])
    elsewhere = plate(0.6)[0]
    now = DepthFrame(plate(0.1)[1], X_WC, PERIOD, CAMERA)
    seen = np.concatenate((elsewhere, arm))
    (thing,) = associate((), front(tip), now, MEMORY, PARAMETERS, seen)
    np.testing.assert_allclose(thing.velocity, [PARAMETERS.usual_speed, 0.0, 0.0], atol=0.005)
    for alone in (np.concatenate((elsewhere, tip)), NOTHING):
        (thing,) = associate((), front(tip), now, MEMORY, PARAMETERS, alone)
        np.testing.assert_array_equal(thing.velocity, np.zeros(3))


def test_two_things_have_velocities_of_their_own():
    before = None
    things = ()
    for number in range(4):
        points = []
        depth = np.full((CAMERA.height, CAMERA.width), 1.5, np.float32)
        for middle in (0.2 + 0.04 * number, -0.2 - 0.06 * number):
            some, image = plate(middle)
            points.append(some)
            depth = np.minimum(depth, image)
        now = DepthFrame(depth, X_WC, PERIOD * number, CAMERA)
        if before is not None:
            new = come(np.concatenate(points), before)
            things = associate(things, new, now, MEMORY, PARAMETERS)
        before = now
    velocities = sorted(thing.velocity[0] for thing in things)
    np.testing.assert_allclose(velocities, [-0.3, 0.2], atol=0.02)


def test_noise_of_a_few_points_is_nothing():
    few = np.array([[0.1, 0.0, 1.0], [0.11, 0.0, 1.0], [0.3, 0.1, 1.0]])
    now = DepthFrame(plate(0.0)[1], X_WC, PERIOD, CAMERA)
    assert associate((), front(few), now, MEMORY, PARAMETERS) == ()


def lost(depth, later):
    """A thing last seen in the middle at 0.25 m/s, and an image some time later."""
    thing = TrackedObstacle(plate(0.0)[0], np.array([0.25, 0.0, 0.0]), 0.0)
    now = DepthFrame(depth, X_WC, later, CAMERA)
    return associate((thing,), front(NOTHING), now, MEMORY, PARAMETERS), now


def test_what_is_lost_where_nothing_is_measured_is_supposed_to_be_there_for_a_while():
    blind = np.zeros((CAMERA.height, CAMERA.width), np.float32)
    things, now = lost(blind, 1.0)
    assert len(things) == 1
    farthest = 0.05 + 0.25 * (1.0 + PARAMETERS.horizon)
    assert soon(things, now)[:, 0].max() == pytest.approx(farthest, abs=0.03)
    assert lost(blind, PARAMETERS.memory + 0.1)[0] == ()


def test_what_was_lost_long_ago_did_not_go_on_for_ever():
    things, now = lost(np.zeros((CAMERA.height, CAMERA.width), np.float32), 5.0)
    farthest = 0.05 + 0.25 * (PARAMETERS.extrapolated + PARAMETERS.horizon)
    assert soon(things, now)[:, 0].max() == pytest.approx(farthest, abs=0.03)


@pytest.mark.parametrize(
    ("speed", "expected"),
    [
        (0.0, 0.0),
        (PARAMETERS.rest_speed / 2, PARAMETERS.rest_speed / 2),
        (0.1, PARAMETERS.usual_speed),
    ],
)
def test_what_has_begun_to_move_may_go_on_faster_but_not_what_stands(speed, expected):
    thing = TrackedObstacle(plate(0.0)[0], np.array([speed, 0.0, 0.0]), 0.0)
    ahead = soon((thing,), DepthFrame(plate(0.0)[1], X_WC, 0.0, CAMERA))
    farthest = 0.05 + expected * PARAMETERS.horizon
    assert ahead[:, 0].max() == pytest.approx(farthest, abs=0.03)


def test_what_is_seen_to_have_gone_is_not_waited_for():
    empty = np.full((CAMERA.height, CAMERA.width), 1.5, np.float32)
    assert lost(empty, PERIOD)[0] == ()


def test_what_stopped_is_not_expected_where_it_is_seen_not_to_be():
    things, now = lost(plate(0.0)[1], 1.0)
    assert len(things) == 1
    assert soon(things, now)[:, 0].max() < 0.07


def test_what_hides_behind_a_hole_is_expected_there():
    veil = np.array([[0.1, 0.2, 0.3]])
    _, now = watch([0.0, 0.0])
    np.testing.assert_array_equal(soon((), now, veil), veil)


def ball(middle, radius=0.06):
    """Points on the side of a ball that a camera sees from behind the origin, and their normals."""
    grid = np.linspace(-1.0, 1.0, 25)
    x, y = (part.ravel() for part in np.meshgrid(grid, grid))
    inside = x**2 + y**2 < 0.9
    x, y = x[inside], y[inside]
    normals = np.stack([x, y, -np.sqrt(1.0 - x**2 - y**2)], axis=1)
    return middle + radius * normals, normals


@pytest.mark.parametrize("step", [[0.05, 0.0, 0.0], [0.0, -0.04, 0.0], [0.03, 0.03, -0.03]])
def test_how_fast_something_moves_is_seen_in_one_step_by_its_shape(step):
    before, _ = ball(np.array([0.1, 0.0, 0.8]))
    points, normals = ball(np.array([0.1, 0.0, 0.8]) + step)
    came = np.flatnonzero((points - [0.1, 0.0, 0.8]) @ step > 0.06 * np.linalg.norm(step))
    some = front(points[came], before, 0.0, normals[came])
    velocity = estimate_velocity(some, PERIOD, PARAMETERS)
    np.testing.assert_allclose(velocity, np.array(step) / PERIOD, atol=0.06)


def test_what_slides_along_itself_shows_its_motion_at_its_end():
    angle, along = np.meshgrid(np.linspace(0, 2 * np.pi, 30), np.linspace(-0.3, 0.0, 31))
    sides = np.stack([along.ravel(), 0.04 * np.sin(angle.ravel()), 0.04 * np.cos(angle.ravel())], 1)
    end, normals = ball(np.zeros(3), 0.04)
    end, normals = (-end[:, [2, 1, 0]], -normals[:, [2, 1, 0]])
    some = front(end + [0.04, 0.0, 0.0], np.concatenate((sides, end)), 0.0, normals)
    velocity = estimate_velocity(some, PERIOD, PARAMETERS)
    np.testing.assert_allclose(velocity, [0.2, 0.0, 0.0], atol=0.03)


def test_the_speed_of_what_came_from_nowhere_is_not_known():
    points, normals = ball(np.zeros(3))
    assert estimate_velocity(front(points, NOTHING, 0.0, normals), PERIOD, PARAMETERS) is None
    far = points + [0.0, 0.0, 0.5]
    assert estimate_velocity(front(points, far, 0.0, normals), PERIOD, PARAMETERS) is None
