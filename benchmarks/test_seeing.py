"""Processing time of an image: depth to the map, marker in a whole image and when tracked."""

import cv2
import numpy as np
import pytest

from pepper_drake.evaluation.perception_evaluation import PerceptionEvaluation
from pepper_drake.models.control_model import shared_control_model
from pepper_drake.models.scene import load_scene
from pepper_drake.perception import (
    CAMERA_DEPTH,
    CAMERA_TOP,
    ColorNoise,
    DepthNoise,
    ExcludedSolids,
    ObstacleParameters,
    RobotSolids,
    VoxelMap,
    apply_color_noise,
    apply_depth_noise,
    detect_goal,
    update_obstacles,
)


@pytest.fixture(scope="module")
def study() -> PerceptionEvaluation:
    """Pepper at the table, looking at the goal; one thread."""
    cv2.setNumThreads(1)
    return PerceptionEvaluation(load_scene("table"))


def test_depth_image_into_the_map(benchmark, study):
    """320x240 to the filtered cloud in the map, without the robot's body and the goal."""
    rig, name, camera = study.rig, CAMERA_DEPTH.name, CAMERA_DEPTH.intrinsics
    model = shared_control_model()
    robot = RobotSolids(model.plant, model.diagram.scene_graph())
    X_WC, X_WO, q = rig.pose(name), study.scene.goal.pose(), rig.pepper_positions()
    images = [
        apply_depth_noise(rig.depth(name), camera, DepthNoise(), seed=0, frame=k) for k in range(20)
    ]
    state = {"voxels": VoxelMap.empty(), "frame": 0}

    def step():
        ignored = [
            ExcludedSolids(robot.solids, robot.poses(q), 0.02, keep_known_voxels=True),
            ExcludedSolids(study.marked.solids, [X_WO] * 2, 0.015),
        ]
        frame = state["frame"]
        state["voxels"] = update_obstacles(
            state["voxels"],
            images[frame % len(images)],
            0.2 * frame,
            X_WC,
            camera,
            ignored,
            ObstacleParameters(),
        )
        state["frame"] += 1

    benchmark(step)
    assert len(state["voxels"]) > 1000


@pytest.mark.parametrize("tracked", [False, True], ids=["whole image", "tracked"])
def test_marker_in_an_image(benchmark, study, tracked):
    """640x480 with noise and lens distortion; the marker 0.9 m away."""
    camera = CAMERA_TOP.intrinsics
    image = apply_color_noise(
        study.rig.color(CAMERA_TOP.name), camera, ColorNoise(), seed=0, frame=0
    )
    X_WC = study.rig.pose(CAMERA_TOP.name)
    p_WM = (study.scene.goal.pose() @ study.marked.X_OM).translation()
    expected = p_WM if tracked else None
    seen = benchmark(detect_goal, image, 0.0, X_WC, camera, study.marked, p_WM_expected=expected)
    assert np.linalg.norm(seen.p_WM - p_WM) < 0.02
