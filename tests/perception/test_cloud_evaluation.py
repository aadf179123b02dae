import numpy as np
import pytest
from pydrake.common import MemoryFile
from pydrake.geometry import Box, Cylinder, InMemoryMesh, Mesh, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.perception.cameras.camera import CAMERA_DEPTH
from pepper_drake.perception.cloud_evaluation import (
    TrueSurfaces,
    best_shift,
    coverage,
    evaluate_cloud,
    visible_surface,
)

NOTHING = TrueSurfaces([])
HERE = RigidTransform()


def box_mesh(size):
    """The twelve triangles of a box."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size / 2
    quads = [(1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    lines += [f"f {a} {b} {c}\nf {a} {c} {d}" for a, b, c, d in quads]
    return Mesh(InMemoryMesh(mesh_file=MemoryFile("\n".join(lines), ".obj", "box")), 1.0)


def test_mesh_and_primitive_of_one_box_agree():
    size = np.array([0.2, 0.3, 0.1])
    points = np.random.default_rng(0).uniform(-1, 1, (300, 3)) * [0.15, 0.2, 0.1]
    closest, distance = TrueSurfaces([(box_mesh(size), HERE)]).closest(points)
    np.testing.assert_allclose(
        distance, TrueSurfaces([(Box(*size), HERE)]).closest(points)[1], atol=1e-9
    )
    np.testing.assert_allclose(np.linalg.norm(closest - points, axis=1), distance, atol=1e-12)


def test_closest_points_are_on_the_nearest_surface():
    X = RigidTransform(RollPitchYaw(0.3, 0.2, 0.1), [1, 2, 3])
    surfaces = TrueSurfaces([(Cylinder(0.1, 0.4), X), (Sphere(0.2), HERE)])
    closest, distance = surfaces.closest(np.array([X @ [0.15, 0, 0], [0, 0.28, 0]]))
    np.testing.assert_allclose(closest, [X @ [0.1, 0, 0], [0, 0.2, 0]], atol=1e-6)
    np.testing.assert_allclose(distance, [0.05, 0.08], atol=1e-6)
    assert np.isinf(NOTHING.closest(np.zeros((1, 3)))[1])
    assert np.isinf(surfaces.closest(np.array([[0.0, 0.0, 5.0]]))[1])


def test_shift_along_x_is_found_though_few_surfaces_face_it():
    rng = np.random.default_rng(0)
    # A table's points: mostly top, a little front.
    top = np.column_stack([rng.uniform(-0.2, 0.2, 900), rng.uniform(-0.3, 0.3, 900), np.zeros(900)])
    front = np.column_stack(
        [np.full(100, -0.25), rng.uniform(-0.3, 0.3, 100), rng.uniform(-0.1, 0, 100)]
    )
    table = TrueSurfaces([(Box(0.5, 0.7, 0.2), RigidTransform([0, 0, -0.1]))])
    points = np.concatenate([top, front]) + np.array([0.006, 0.0, 0.002])
    shift = best_shift(points, table.closest(points)[0])
    np.testing.assert_allclose(shift, [0.006, 0, 0.002], atol=3e-4)
    assert best_shift(points, points) == (0, 0, 0)


def test_coverage_is_the_share_near_a_point():
    visible = np.column_stack([np.linspace(0, 1, 101), np.zeros(101), np.zeros(101)])
    assert coverage(visible[:51], visible, within=0.005) == pytest.approx(51 / 101)
    assert coverage(np.zeros((0, 3)), visible) == 0
    assert coverage(visible, np.zeros((0, 3))) == 1


def test_report_counts_each_kind_of_point():
    table = TrueSurfaces([(Box(1, 1, 0.1), RigidTransform([0, 0, -0.05]))])
    robot = TrueSurfaces([(Sphere(0.1), RigidTransform([0, 0, 0.5]))])
    goal = TrueSurfaces([(Sphere(0.1), RigidTransform([0, 0.3, 0.5]))])
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
