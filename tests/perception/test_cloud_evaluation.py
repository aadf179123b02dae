import numpy as np
import pytest
from pydrake.geometry import Box, Cylinder, Sphere
from pydrake.math import RigidTransform, RollPitchYaw
from scipy.spatial import cKDTree

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.cloud_evaluation import (
    TrueSurfaces,
    best_shift,
    coverage,
    evaluate_cloud,
    visible_surface,
)
from pepper_drake.perception.mapping.solids import Solid

NO_TRIANGLES = np.zeros((0, 3, 3))
NOTHING = TrueSurfaces([], [], NO_TRIANGLES)


def box_triangles(size):
    """The twelve triangles of a box."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size / 2
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return np.array([corners[list(t)] for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def test_mesh_and_primitive_of_one_box_agree():
    size = np.array([0.2, 0.3, 0.1])
    points = np.random.default_rng(0).uniform(-1, 1, (300, 3)) * [0.19, 0.24, 0.14]
    solid = TrueSurfaces([Solid(Box(*size), RigidTransform())], [RigidTransform()], NO_TRIANGLES)
    mesh = TrueSurfaces([], [], box_triangles(size))
    closest, distance = mesh.closest(points)
    np.testing.assert_allclose(distance, solid.closest(points)[1], atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(closest - points, axis=1), distance, atol=1e-12)


def test_of_many_triangles_the_nearest_is_found():
    rng = np.random.default_rng(1)
    # Slivers and large ones, and points that are nearest to a corner, an edge or a face.
    triangles = rng.uniform(-0.3, 0.3, (60, 1, 3)) + rng.normal(size=(60, 3, 3)) * rng.choice(
        [0.01, 0.2], (60, 1, 1)
    )
    points = rng.uniform(-0.3, 0.3, (700, 3))
    # Sampled densely, no triangle is nearer, and the nearest sample is hardly farther.
    weights = rng.dirichlet(np.ones(3) * 0.6, 4000)
    samples = np.einsum("sk,tki->tsi", weights, triangles).reshape(-1, 3)
    sampled, _ = cKDTree(samples).query(points)
    closest, distance = TrueSurfaces([], [], triangles).closest(points)
    assert np.all(distance <= sampled + 1e-12)
    assert np.max(sampled - distance) < 0.03
    assert np.median(sampled - distance) < 0.001
    np.testing.assert_allclose(np.linalg.norm(closest - points, axis=1), distance, atol=1e-12)


def test_distances_alone_are_those_of_the_closest_points():
    points = np.random.default_rng(2).uniform(-0.3, 0.3, (200, 3))
    X = RigidTransform(RollPitchYaw(0.3, 0.2, 0.1), [0.1, 0, 0])
    surfaces = TrueSurfaces(
        [Solid(Cylinder(0.1, 0.4), RigidTransform([0, 0, 0.1])), Solid(Sphere(0.2), X)],
        [X, RigidTransform()],
        box_triangles(np.array([0.2, 0.3, 0.1])),
    )
    np.testing.assert_allclose(surfaces.distance(points), surfaces.closest(points)[1], atol=1e-9)
    assert np.isinf(NOTHING.distance(np.zeros((1, 3))))


def test_closest_points_are_on_the_nearest_surface():
    X = RigidTransform(RollPitchYaw(0.3, 0.2, 0.1), [1, 2, 3])
    surfaces = TrueSurfaces(
        [Solid(Cylinder(0.1, 0.4), RigidTransform()), Solid(Sphere(0.2), RigidTransform())],
        [X, RigidTransform()],
        NO_TRIANGLES,
    )
    closest, distance = surfaces.closest(np.array([X @ [0.15, 0, 0], [0, 0.3, 0]]))
    np.testing.assert_allclose(closest, [X @ [0.1, 0, 0], [0, 0.2, 0]], atol=1e-6)
    np.testing.assert_allclose(distance, [0.05, 0.1], atol=1e-6)
    assert np.isinf(NOTHING.closest(np.zeros((1, 3)))[1])


def test_shift_along_x_is_found_though_few_surfaces_face_it():
    rng = np.random.default_rng(0)
    size = np.array([0.05, 0.6, 0.6])
    box = TrueSurfaces([Solid(Box(*size), RigidTransform())], [RigidTransform()], NO_TRIANGLES)
    # Mostly the two large faces along x; here a table's: mostly top, a little front.
    top = np.column_stack([rng.uniform(-0.2, 0.2, 900), rng.uniform(-0.3, 0.3, 900), np.zeros(900)])
    front = np.column_stack(
        [np.full(100, -0.25), rng.uniform(-0.3, 0.3, 100), rng.uniform(-0.1, 0, 100)]
    )
    table = TrueSurfaces(
        [Solid(Box(0.5, 0.7, 0.2), RigidTransform([0, 0, -0.1]))], [RigidTransform()], NO_TRIANGLES
    )
    points = np.concatenate([top, front]) + np.array([0.006, 0.0, 0.002])
    shift = best_shift(points, table.closest(points)[0])
    np.testing.assert_allclose(shift, [0.006, 0, 0.002], atol=3e-4)
    assert best_shift(points, points) == (0, 0, 0)
    assert box.closest(points)[1].shape == (1000,)


def test_coverage_is_the_share_near_a_point():
    visible = np.column_stack([np.linspace(0, 1, 101), np.zeros(101), np.zeros(101)])
    assert coverage(visible[:51], visible, within=0.005) == pytest.approx(51 / 101)
    assert coverage(np.zeros((0, 3)), visible) == 0
    assert coverage(visible, np.zeros((0, 3))) == 1


def test_report_counts_each_kind_of_point():
    table = TrueSurfaces(
        [Solid(Box(1, 1, 0.1), RigidTransform([0, 0, -0.05]))], [RigidTransform()], NO_TRIANGLES
    )
    robot = TrueSurfaces(
        [Solid(Sphere(0.1), RigidTransform([0, 0, 0.5]))], [RigidTransform()], NO_TRIANGLES
    )
    goal = TrueSurfaces(
        [Solid(Sphere(0.1), RigidTransform([0, 0.3, 0.5]))], [RigidTransform()], NO_TRIANGLES
    )
    on_table = [[x, y, 0.004] for x in (-0.3, 0, 0.3) for y in (-0.3, 0, 0.3)]
    points = np.array([*on_table, [0, 0, 0.6], [0, 0.3, 0.601], [0, 0, 0.2]])
    report = evaluate_cloud(points, table, np.array([[0, 0, 0.0], [0.4, 0.4, 0]]), robot, goal)
    assert report.points == 12
    assert report.rms_error == pytest.approx(0.004, abs=1e-6)
    assert report.outlier_share == pytest.approx(3 / 12)
    assert (report.robot_points, report.goal_points) == (1, 1)
    assert report.coverage == 0.5
    assert report.bias[2] == pytest.approx(0.004, abs=1e-4)


def test_empty_cloud_is_reported():
    report = evaluate_cloud(np.zeros((0, 3)), NOTHING, np.zeros((1, 3)), NOTHING, NOTHING)
    assert (report.points, report.coverage, report.outlier_share) == (0, 0, 0)


def test_visible_surface_is_evenly_spread():
    camera = CAMERA_DEPTH.intrinsics
    depth = np.full((camera.height, camera.width), 1.0, np.float32)
    depth[:, :100] = np.inf
    shown = np.ones(depth.shape, dtype=bool)
    shown[:, 200:] = False
    points = visible_surface(depth, camera, RigidTransform(), shown, max_range=1.2, spacing=0.02)
    width = 100 / camera.focal_x
    height = camera.height / camera.focal_y
    assert len(points) == pytest.approx(width * height / 0.02**2, rel=0.1)
    np.testing.assert_allclose(points[:, 2], 1.0)
    assert len(visible_surface(depth, camera, RigidTransform(), shown, max_range=0.9)) == 0
