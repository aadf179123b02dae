"""The whole way from a rendered depth image to the remembered obstacles, against the truth."""

import numpy as np
import pytest
from pydrake.math import RigidTransform

from pepper_drake.errors import InputError
from pepper_drake.evaluation.camera_rig import CameraRig
from pepper_drake.models.control_model import ControlModel
from pepper_drake.models.pepper import clamp_coupled_limits
from pepper_drake.models.scene import load_scene
from pepper_drake.perception.cameras.camera import CAMERA_DEPTH, CameraIntrinsics, HeadCamera
from pepper_drake.perception.cameras.noise import DepthNoise, apply_depth_noise
from pepper_drake.perception.cloud_evaluation import evaluate_cloud, visible_surface
from pepper_drake.perception.goal.detection import MarkedObject
from pepper_drake.perception.mapping.obstacle_map import (
    ExcludedSolids,
    ObstacleParameters,
    update_obstacles,
)
from pepper_drake.perception.mapping.solids import RobotSolids
from pepper_drake.perception.mapping.voxel_map import VoxelMap

pytestmark = pytest.mark.render

# A camera that sees nearer than the real one, so that the arms are in its view, too.
NEAR = CameraIntrinsics.from_vertical_fov(320, 240, np.pi / 4, near=0.1, far=8.0)
CAMERA = HeadCamera("CameraDepth", NEAR, CAMERA_DEPTH.p_HeadC, 0.0)
PARAMETERS = ObstacleParameters()


class Table:
    """The shipped table, looked at by a posed Pepper."""

    def __init__(self):
        scene = load_scene("table")
        # Both can then be moved.
        scene.goal.path = [[0.0, 0, 0, 0], [1.0, 0, 0, 0]]
        for obstacle in scene.obstacles:
            if obstacle.name == "mug":
                obstacle.path = [[0.0, 0, 0, 0], [1.0, 0, 0, 0]]
        self.rig = CameraRig(scene, (CAMERA,))
        self.marked = MarkedObject.from_scene(scene.goal)
        model = ControlModel()
        self.robot = RobotSolids(model.plant, model.diagram.scene_graph())
        self.frame = 0
        self.noise = DepthNoise()

    def ignored(self, X_WO=None):
        X_WO = self.rig.body_pose("goal_object") if X_WO is None else X_WO
        poses = self.robot.poses(self.rig.pepper_positions())
        cloud = PARAMETERS.cloud
        return [
            ExcludedSolids(self.robot.solids, poses, cloud.robot_margin, keep_known_voxels=True),
            ExcludedSolids(self.marked.solids, [X_WO] * 2, cloud.object_margin),
        ]

    def look(self, voxels, ignored=None, image=None):
        self.frame += 1
        if image is None:
            depth = self.rig.depth("CameraDepth")
            image = apply_depth_noise(depth, NEAR, self.noise, seed=0, frame=self.frame)
        return update_obstacles(
            voxels,
            image,
            0.2 * self.frame,
            self.rig.pose("CameraDepth"),
            NEAR,
            self.ignored() if ignored is None else ignored,
            PARAMETERS,
        )

    def report(self, voxels):
        rig = self.rig
        obstacles = rig.scene_models.obstacles
        visible = visible_surface(
            rig.depth("CameraDepth"),
            NEAR,
            rig.pose("CameraDepth"),
            rig.shows("CameraDepth", obstacles),
            max_range=1.2,
        )
        return evaluate_cloud(
            voxels.positions,
            rig.surfaces(obstacles),
            visible,
            rig.surfaces(rig.pepper_bodies()),
            rig.surfaces(["goal_object"]),
        )


@pytest.fixture(scope="module")
def table():
    return Table()


@pytest.fixture
def standing(table):
    """The table from afar, everything in its place."""
    table.rig.set_positions(load_scene("table").robot.positions())
    table.rig.set_positions({"HeadYaw": -0.1, "HeadPitch": 0.35})
    table.rig.move_object("mug", np.zeros(3))
    table.rig.move_object("goal_object", np.zeros(3))
    return table


def test_cloud_is_as_good_as_promised(standing):
    voxels = VoxelMap.empty()
    for _ in range(4):
        voxels = standing.look(voxels)
    report = standing.report(voxels)
    assert report.rms_error < 0.003
    assert max(np.abs(report.bias)) < 0.002
    assert report.coverage > 0.97
    assert report.outlier_share < 0.002
    assert (report.robot_points, report.goal_points) == (0, 0)


def test_arms_and_goal_leave_no_points_whatever_the_pose(table):
    rng = np.random.default_rng(0)
    seen = 0
    for _ in range(8):
        pose = {
            "HeadYaw": rng.uniform(-0.9, 0.5),
            "HeadPitch": rng.uniform(0.1, 0.4),
            "BaseX": rng.uniform(0, 0.4),
        }
        for side, sign in (("R", -1), ("L", 1)):
            pose |= {
                f"{side}ShoulderPitch": rng.uniform(-0.3, 0.9),
                f"{side}ShoulderRoll": sign * rng.uniform(0.02, 0.5),
                f"{side}ElbowYaw": rng.uniform(-1.5, 1.5),
                f"{side}ElbowRoll": -sign * rng.uniform(0.02, 1.3),
            }
        table.rig.set_positions(clamp_coupled_limits(pose))
        seen += np.count_nonzero(table.rig.shows("CameraDepth", table.rig.pepper_bodies()))
        report = table.report(table.look(VoxelMap.empty()))
        assert (report.robot_points, report.goal_points) == (0, 0)
    assert seen > 1000  # Else the test shows nothing.


def points_near(voxels, place):
    return np.count_nonzero(np.linalg.norm(voxels.positions - place, axis=1) < 0.05)


def test_moved_obstacle_leaves_no_ghost(standing):
    # From here the floor is seen wherever the mug is not; what nothing comes back from is unknown.
    standing.rig.set_positions({"BaseX": 0.3})
    voxels = VoxelMap.empty()
    for _ in range(6):
        voxels = standing.look(voxels)
    middle = np.array([0, 0, 0.05])
    old = standing.rig.body_pose("mug").translation() + middle
    before = points_near(voxels, old)
    assert before > 20
    standing.rig.move_object("mug", [0.0, -0.12, 0.0])
    new = standing.rig.body_pose("mug").translation() + middle
    voxels = standing.look(voxels)
    assert points_near(voxels, new) > 0.5 * before  # There within one frame.
    voxels = standing.look(voxels)
    assert points_near(voxels, old) <= 2  # 0.4 s after the move.


def test_goal_seen_before_it_was_known_leaves_no_ghost(standing):
    voxels = standing.look(VoxelMap.empty(), ignored=[])
    assert standing.report(voxels).goal_points > 0
    voxels = standing.look(voxels)
    assert standing.report(voxels).goal_points == 0


def test_moved_goal_leaves_no_ghost(standing):
    voxels = standing.look(VoxelMap.empty())
    standing.rig.move_object("goal_object", [0.0, 0.08, 0.05])
    voxels = standing.look(voxels)
    assert standing.report(voxels).goal_points == 0


def test_what_was_seen_from_afar_is_still_there_when_near(standing):
    voxels = VoxelMap.empty()
    for _ in range(3):
        voxels = standing.look(voxels)
    before = len(voxels)
    standing.rig.set_positions({"BaseX": 0.45, "HeadYaw": -0.8, "HeadPitch": 0.2})
    for _ in range(3):
        voxels = standing.look(voxels)
    assert len(voxels) > 0.95 * before
    assert standing.report(voxels).outlier_share < 0.002


def test_hand_near_an_obstacle_does_not_make_it_forgotten(standing):
    voxels = standing.look(VoxelMap.empty())
    mug = standing.rig.body_pose("mug").translation()
    hand = RigidTransform(mug - [0.065, 0, -0.05])  # A palm's box, 2 cm from the mug's wall.
    poses = [hand] * len(standing.robot.solids)
    close = ExcludedSolids(standing.robot.solids[-1:], poses[:1], 0.05, keep_known_voxels=True)
    blind = np.zeros((240, 320), np.uint16)
    kept = standing.look(voxels, ignored=[close], image=blind)
    forgotten = standing.look(
        voxels, ignored=[ExcludedSolids(close.solids, close.poses, 0.05)], image=blind
    )
    assert len(forgotten) < len(kept)
    assert len(kept) > 0.99 * len(voxels)


@pytest.mark.parametrize("fault", ["blind", "far", "nan", "none", "salt and pepper"])
def test_faulty_images_spoil_nothing(standing, fault):
    voxels = VoxelMap.empty()
    for _ in range(3):
        voxels = standing.look(voxels)
    rng = np.random.default_rng(0)
    good = apply_depth_noise(
        standing.rig.depth("CameraDepth"), NEAR, DepthNoise(), seed=0, frame=999
    )
    salted = good.copy()
    salted[rng.random(good.shape) < 0.1] = 0
    salted[rng.random(good.shape) < 0.1] = 65535
    image = {
        "blind": np.zeros_like(good),
        "far": np.full_like(good, 65535),
        "nan": np.full(good.shape, np.nan, np.float32),
        "none": np.zeros((0, 0, 1), np.uint16),
        "salt and pepper": salted,
    }[fault]
    after = standing.look(voxels, image=image)
    report = standing.report(after)
    assert report.coverage > 0.97
    assert report.outlier_share < 0.002


def test_images_of_another_size_or_unit_are_refused(standing):
    good = apply_depth_noise(
        standing.rig.depth("CameraDepth"), NEAR, DepthNoise(), seed=0, frame=999
    )
    with pytest.raises(InputError, match="320x120"):
        standing.look(VoxelMap.empty(), image=good[:120])
    with pytest.raises(InputError, match="below the floor"):
        standing.look(VoxelMap.empty(), image=3 * good)


def test_torn_image_leaves_nothing_that_stays(standing, monkeypatch):
    # In the projector's shadow nothing would tell what is empty.
    lit = DepthNoise(baseline=0.0)
    monkeypatch.setattr(standing, "noise", lit)
    voxels = VoxelMap.empty()
    for _ in range(3):
        voxels = standing.look(voxels)
    first = apply_depth_noise(standing.rig.depth("CameraDepth"), NEAR, lit, seed=0, frame=800)
    standing.rig.set_positions({"HeadYaw": 0.1})
    second = apply_depth_noise(standing.rig.depth("CameraDepth"), NEAR, lit, seed=0, frame=801)
    torn = np.concatenate([second[:120], first[120:]])
    voxels = standing.look(voxels, image=torn)
    for _ in range(3):
        voxels = standing.look(voxels)
    report = standing.report(voxels)
    assert report.outlier_share < 0.01
    assert report.coverage > 0.97
