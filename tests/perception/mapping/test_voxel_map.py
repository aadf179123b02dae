import copy

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydrake.math import RigidTransform

from pepper_drake.errors import InputError
from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.mapping.cloud import CloudParameters, SurfacePoints, observe_surfaces
from pepper_drake.perception.mapping.voxel_map import (
    VoxelMap,
    VoxelMapParameters,
    add_points,
    carve_free_space,
    prune,
    sees_free_space,
    voxel_keys,
)

CAMERA = CAMERA_DEPTH.intrinsics
PARAMETERS = VoxelMapParameters(voxel_size=0.02)
X_WC = RigidTransform([0, 0, 0.0])  # Looks along +z.


def surface(points, normals=None):
    points = np.asarray(points, np.float32)
    if normals is None:
        normals = np.full_like(points, np.nan)
    return SurfacePoints(points, np.asarray(normals, np.float32))


def wall(depth):
    return np.full((CAMERA.height, CAMERA.width), depth, np.float32)


@given(st.integers(0, 1000))
def test_points_share_a_key_exactly_when_they_share_a_voxel(seed):
    points = np.random.default_rng(seed).uniform(-3, 3, (200, 3))
    keys = voxel_keys(points, 0.5)
    cells = np.floor(points / 0.5)
    same = np.all(cells[:, None] == cells[None], axis=2)
    np.testing.assert_array_equal(keys[:, None] == keys[None], same)


def test_voxels_hold_means_of_all_their_points():
    first = [[0.001, 0.001, 1.0], [0.003, 0.001, 1.0], [0.5, 0.5, 1.0]]
    voxels = add_points(VoxelMap.empty(), surface(first), 0.0, PARAMETERS)
    assert len(voxels) == 2
    voxels = add_points(voxels, surface([[0.011, 0.001, 1.0], [-0.5, 0, 1.0]]), 0.2, PARAMETERS)
    assert len(voxels) == 3
    assert np.all(np.diff(voxels.keys) > 0)
    (place,) = np.flatnonzero(voxels.keys == voxel_keys(np.array([first[0]]), 0.02))
    np.testing.assert_allclose(voxels.positions[place], [0.005, 0.001, 1.0], atol=1e-6)
    assert voxels.weights[place] == 3
    assert voxels.scores[place] == 2
    assert voxels.hit_times[place] == 0.2


def test_near_the_goal_object_an_edge_is_measured_twice_as_closely():
    # A plate 0.222 m wide, densely measured: no voxel of either size ends where it does.
    x, y = np.mgrid[0.0:1.0:0.002, -0.111:0.1111:0.001].reshape(2, -1)
    plate = surface(np.column_stack((x, y, np.ones_like(x))))
    voxels = add_points(VoxelMap.empty(), plate, 0.0, VoxelMapParameters(), np.array([0, 0, 1.0]))
    beyond = np.linalg.norm(voxels.positions - [0, 0, 1.0], axis=1) > 0.26
    near_edge, far_edge = (voxels.positions[part, 1].max() for part in (~beyond, beyond))
    np.testing.assert_allclose([near_edge, far_edge], [0.109, 0.1055], atol=3e-4)
    assert np.all(np.diff(voxels.keys) > 0)


def test_small_and_large_voxels_are_told_apart():
    # The 32nd small voxel and the 32nd large one.
    points = surface([[0.201, 0.001, 0.001], [0.401, 0.001, 0.001]])
    assert len(add_points(VoxelMap.empty(), points, 0.0, VoxelMapParameters(), np.zeros(3))) == 2


def test_voxels_of_the_other_size_disappear_once_the_goal_object_has_moved():
    here, there = np.array([0.0, 0.0, 0.8]), np.array([0.0, 0.3, 0.8])
    seen = observe_surfaces(wall(0.8), CAMERA, X_WC, CloudParameters(floor_height=-1.0))

    def look(voxels, p_WO, frames):
        for time in frames:
            voxels = add_points(voxels, seen, time, VoxelMapParameters(), p_WO)
            voxels = carve_free_space(voxels, wall(0.8), CAMERA, X_WC, time, VoxelMapParameters())
        return voxels

    before = look(VoxelMap.empty(), here, range(3))
    after = look(before, there, range(3, 9))
    np.testing.assert_array_equal(after.keys, look(VoxelMap.empty(), there, range(1)).keys)
    assert not np.isin(before.keys, after.keys).all()


def test_normals_are_means_of_those_that_are_known():
    points = [[0.001, 0.001, 1.0], [0.002, 0.001, 1.0], [0.003, 0.001, 1.0], [0.5, 0, 1]]
    normals = [[0, 0, -1], [0, 0.6, -0.8], [np.nan] * 3, [np.nan] * 3]
    voxels = add_points(VoxelMap.empty(), surface(points, normals), 0.0, PARAMETERS)
    seen = voxels.surface()
    place = np.argmin(seen.positions[:, 0])
    mean = np.array([0, 0.6, -1.8]) / np.linalg.norm([0, 0.6, -1.8])
    np.testing.assert_allclose(seen.normals[place], mean, atol=1e-6)
    assert np.isnan(seen.normals[1 - place]).all()


def test_mean_follows_what_changes_slowly():
    voxels = VoxelMap.empty()
    for k in range(200):
        voxels = add_points(voxels, surface([[0.001, 0.001, 1.001]] * 3), 0.2 * k, PARAMETERS)
    for k in range(60):
        voxels = add_points(voxels, surface([[0.015, 0.001, 1.001]] * 3), 50 + k, PARAMETERS)
    np.testing.assert_allclose(voxels.positions[0], [0.015, 0.001, 1.001], atol=1e-3)


def test_what_is_looked_through_goes_after_two_frames():
    voxels = VoxelMap.empty()
    for k in range(10):
        voxels = add_points(voxels, surface([[0, 0, 0.8]]), 0.2 * k, PARAMETERS)
    once = carve_free_space(voxels, wall(1.2), CAMERA, X_WC, 2.0, PARAMETERS)
    assert len(once) == 1
    assert len(carve_free_space(once, wall(1.2), CAMERA, X_WC, 2.2, PARAMETERS)) == 0
    # What was seen but once goes at once.
    fresh = add_points(VoxelMap.empty(), surface([[0, 0, 0.8]]), 0.0, PARAMETERS)
    assert len(carve_free_space(fresh, wall(1.2), CAMERA, X_WC, 0.2, PARAMETERS)) == 0


@pytest.mark.parametrize(
    ("name", "depth"),
    [
        ("hidden behind something", wall(0.5)),
        ("nothing came back", wall(0.0)),
        ("no image", np.zeros((0, 0), np.float32)),
    ],
)
def test_what_is_not_looked_through_stays(name, depth):
    voxels = add_points(VoxelMap.empty(), surface([[0, 0, 0.8]]), 0.0, PARAMETERS)
    assert carve_free_space(voxels, depth, CAMERA, X_WC, 0.2, PARAMETERS).scores.tolist() == [1], (
        name
    )


def test_voxel_whose_surface_is_seen_elsewhere_is_doubted():
    voxels = VoxelMap.empty()
    for k in range(3):
        voxels = add_points(voxels, surface([[0, 0, 0.8]]), 0.2 * k, PARAMETERS)
    doubted = carve_free_space(voxels, wall(0.805), CAMERA, X_WC, 0.6, PARAMETERS)
    assert doubted.scores.tolist() == [2]
    spared = carve_free_space(voxels, wall(0.805), CAMERA, X_WC, 0.6, PARAMETERS, np.array([True]))
    assert spared.scores.tolist() == [3]


def test_voxels_hit_now_beside_and_behind_the_camera_stay():
    points = [[0, 0, 0.8], [3.0, 0, 0.8], [0, 0, -0.8]]
    voxels = add_points(VoxelMap.empty(), surface(points), 0.0, PARAMETERS)
    assert len(carve_free_space(voxels, wall(1.2), CAMERA, X_WC, 0.0, PARAMETERS)) == 3
    assert len(carve_free_space(voxels, wall(1.2), CAMERA, X_WC, 0.2, PARAMETERS)) == 2


@pytest.mark.parametrize(("lost", "near", "left"), [(5, 0, 0), (6, 0, 1), (0, 1, 1)])
def test_rays_carve_when_enough_of_them_and_all_of_them_pass(lost, near, left):
    voxels = add_points(VoxelMap.empty(), surface([[0.0, 0, 0.8]]), 0.0, PARAMETERS)
    u, v = np.rint(CAMERA.project([0, 0, 0.8])).astype(int)
    depth = wall(1.2)
    around = depth[v - 1 : v + 2, u - 1 : u + 2].ravel()
    around[:lost] = 0
    around[8 - near : 8] = 0.8
    depth[v - 1 : v + 2, u - 1 : u + 2] = around.reshape(3, 3)
    assert len(carve_free_space(voxels, depth, CAMERA, X_WC, 0.2, PARAMETERS)) == left


def test_the_old_and_the_far_are_forgotten():
    parameters = VoxelMapParameters(voxel_size=0.02, max_age=5.0, max_distance=2.0)
    voxels = add_points(VoxelMap.empty(), surface([[0, 0, 1], [0, 0, 2.5]]), 0.0, parameters)
    kept = prune(voxels, np.zeros(3), 4.0, parameters)
    np.testing.assert_allclose(kept.positions, [[0, 0, 1]])
    assert len(prune(kept, np.zeros(3), 6.0, parameters)) == 0
    assert len(prune(VoxelMap.empty(), np.zeros(3), 6.0, parameters)) == 0


def test_maps_are_values():
    voxels = add_points(VoxelMap.empty(), surface([[0, 0, 0.8]]), 0.0, PARAMETERS)
    before = copy.copy(voxels.scores)
    carve_free_space(voxels, wall(1.2), CAMERA, X_WC, 0.2, PARAMETERS)
    add_points(voxels, surface([[0, 0, 0.8]]), 0.4, PARAMETERS)
    np.testing.assert_array_equal(voxels.scores, before)
    assert copy.deepcopy(voxels) is voxels
    assert add_points(voxels, surface(np.zeros((0, 3))), 1.0, PARAMETERS) is voxels


def test_bad_voxel_size_is_named():
    with pytest.raises(InputError, match="voxel_size"):
        VoxelMapParameters(voxel_size=0.0)


def test_an_image_looks_through_what_is_clearly_nearer_than_all_around_it():
    places = np.array([[0, 0, 0.8], [0, 0, 0.99], [0, 0, 1.2], [5.0, 0, 1.0], [0, 0, -1.0]])
    through = sees_free_space(places, wall(1.0), CAMERA, X_WC, PARAMETERS)
    np.testing.assert_array_equal(through, [True, False, False, False, False])
    assert not sees_free_space(places, wall(0.0), CAMERA, X_WC, PARAMETERS).any()
    thin = wall(1.0)
    thin[:, CAMERA.width // 2] = 0.7
    assert not sees_free_space(places[:1], thin, CAMERA, X_WC, PARAMETERS).any()
    assert len(sees_free_space(places[:0], wall(1.0), CAMERA, X_WC, PARAMETERS)) == 0
