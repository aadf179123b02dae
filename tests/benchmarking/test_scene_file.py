import json
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from pydrake.geometry import Sphere
from pydrake.math import RigidTransform
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import pepper_drake
from pepper_drake.benchmarking.scene_file import write_scene_file
from pepper_drake.models.random_scene import random_scene
from pepper_drake.models.scene import load_scene
from pepper_drake.models.scene_families import family_scene
from pepper_drake.models.shapes import distances

ROOT = Path(pepper_drake.__file__).parents[1]


def read(scene, tmp_path):
    """A scene's file, read with nothing of ours."""
    write_scene_file(scene, tmp_path / "scene.json")
    return json.loads((tmp_path / "scene.json").read_text())


def inside(solid, points):
    """Which of points (N, 3) in W lie in a solid of the file."""
    R = Rotation.from_quat(np.roll(solid["quaternion"], -1))
    p = R.inv().apply(points - solid["position"])
    size = solid["size"]
    if solid["shape"] == "box":
        return np.all(np.abs(p) <= np.array(size) / 2, axis=1)
    if solid["shape"] == "sphere":
        return np.linalg.norm(p, axis=1) <= size[0]
    if solid["shape"] == "cylinder":
        return (np.hypot(p[:, 0], p[:, 1]) <= size[0]) & (np.abs(p[:, 2]) <= size[1] / 2)
    if solid["shape"] == "capsule":
        p[:, 2] -= np.clip(p[:, 2], -size[1] / 2, size[1] / 2)
        return np.linalg.norm(p, axis=1) <= size[0]
    assert solid["shape"] == "convex"
    planes = ConvexHull(solid["vertices"]).equations
    return np.all(p @ planes[:, :3].T + planes[:, 3] <= 0.0, axis=1)


@pytest.mark.parametrize(
    "scene",
    [load_scene("clutter"), random_scene(4, moving=True), family_scene("bin", 1)],
    ids=lambda scene: scene.name,
)
def test_a_stranger_finds_the_same_solids_in_the_file(scene, tmp_path):
    content = read(scene, tmp_path)
    solids = [content["goal"]["object"], *content["obstacles"]]
    placed = scene.solids()
    assert len(solids) == len(placed)
    rng = np.random.default_rng(0)
    for solid, own in zip(solids, placed, strict=True):
        assert solid.get("name", "goal") == own.name
        points = own.X_WS.translation() + rng.uniform(-0.15, 0.15, (60, 3))
        grain = [RigidTransform(p) for p in points]
        gaps = distances(Sphere(1e-6), grain, [own])[:, 0]
        sure = np.abs(gaps) > 1e-4
        np.testing.assert_array_equal(inside(solid, points)[sure], gaps[sure] < 0.0)


def test_a_path_between_its_rows_is_the_scenes(tmp_path):
    scene = random_scene(4, moving=True)
    obstacle = scene.obstacles[-1]
    rows = np.array(read(scene, tmp_path)["obstacles"][-1]["path"])
    times, poses = obstacle.poses_along(0.007)
    offsets = [np.interp(times, rows[:, 0], rows[:, k]) for k in (1, 2, 3)]
    expected = np.array([X.translation() for X in poses]) - obstacle.position
    np.testing.assert_allclose(np.transpose(offsets), expected, atol=2e-4)


def test_joints_and_frames_are_in_the_urdf_that_is_named(tmp_path):
    scene = load_scene("table")
    content = read(scene, tmp_path)
    tree = ET.parse(ROOT / content["robot"]["urdf"])
    links = {link.get("name") for link in tree.iter("link")}
    joints = {joint.get("name") for joint in tree.iter("joint")}
    assert {content["robot"]["hand_frame"]} <= links
    assert {camera["frame"] for camera in content["cameras"]} <= links
    assert {*content["robot"]["arm_joints"], *content["robot"]["joint_positions"]} <= joints
    X_WG = scene.goal.pose() @ scene.pre_grasp()
    assert content["goal"]["hand"]["position"] == pytest.approx(X_WG.translation())
    R = Rotation.from_quat(np.roll(content["goal"]["hand"]["quaternion"], -1))
    np.testing.assert_allclose(R.as_matrix(), X_WG.rotation().matrix(), atol=1e-12)
