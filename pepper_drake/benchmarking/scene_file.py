"""A scene as a JSON file that other programs can read; see docs/arena.md."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Convex
from pydrake.math import RigidTransform

from pepper_drake.files import write_atomically
from pepper_drake.models.control_model import arm_joints
from pepper_drake.models.motion import path_trajectory
from pepper_drake.models.pepper import hand_frame
from pepper_drake.models.scene import Obstacle, Scene
from pepper_drake.perception.calibration.calibrated_cameras import HEAD_CAMERA_MODELS

Array = npt.NDArray[np.float64]

FORMAT = "pepper arena scene"
VERSION = 1
POSITION_TOLERANCE = 0.010
"""Position error of the hand within which a run counts as reached [m]."""
_PATH_STEP = 0.02
"""Largest time between the rows of a path [s]."""


def scene_content(scene: Scene) -> dict[str, Any]:
    """Returns a scene as plain numbers, names and lists: m, rad, s; quaternions as w, x, y, z."""
    X_WO, hand = scene.goal.pose(), scene.goal.pre_grasp
    X_OC = RigidTransform([0.0, 0.0, scene.goal.height / 2])
    return {
        "format": FORMAT,
        "version": VERSION,
        "name": scene.name,
        "robot": {
            "urdf": "pepper_drake/models/pepper/pepper_standard.urdf",
            "srdf": "pepper_drake/models/pepper/pepper.srdf",
            "joint_positions": scene.robot.positions(),
            "arm_joints": list(arm_joints(scene.arm)),
            "hand_frame": hand_frame(scene.arm),
        },
        "cameras": [
            {
                "name": name,
                "frame": camera.frame_name,
                "width": camera.intrinsics.width,
                "height": camera.intrinsics.height,
                "focal": [camera.intrinsics.focal_x, camera.intrinsics.focal_y],
                "center": [camera.intrinsics.center_x, camera.intrinsics.center_y],
                "distortion": list(camera.intrinsics.distortion),
            }
            for name, camera in HEAD_CAMERA_MODELS.items()
        ],
        "goal": {
            "hand": _pose(X_WO @ scene.pre_grasp()),
            "position_tolerance": POSITION_TOLERANCE,
            "axis": list(hand.axis),
            "axis_tolerance": hand.tolerance,
            "object": {
                "shape": "cylinder",
                "size": [scene.goal.radius, scene.goal.height],
                **_pose(X_WO @ X_OC),
                "path": _path(scene.goal.path),
            },
            "marker": {
                "dictionary": "DICT_4X4_50",
                "id": scene.goal.marker.id,
                "size": scene.goal.marker.size,
                **_pose(X_WO @ scene.goal.marker.pose()),
            },
        },
        "obstacles": [_obstacle(obstacle) for obstacle in scene.obstacles],
    }


def write_scene_file(scene: Scene, path: Path) -> None:
    """Writes `scene_content` as JSON."""
    write_atomically(path, json.dumps(scene_content(scene), indent=1) + "\n")


def _obstacle(obstacle: Obstacle) -> dict[str, Any]:
    content = {
        "name": obstacle.name,
        "shape": obstacle.shape,
        "size": list(obstacle.size),
        **_pose(obstacle.pose()),
        "path": _path(obstacle.path),
    }
    solid = obstacle.solid()
    if isinstance(solid, Convex):
        hull = solid.GetConvexHull()
        corners = [hull.vertex(k).tolist() for k in range(hull.num_vertices())]
        content |= {"shape": "convex", "size": [], "vertices": corners}
    return content


def _pose(X_WS: RigidTransform) -> dict[str, list[float]]:
    return {
        "position": X_WS.translation().tolist(),
        "quaternion": X_WS.rotation().ToQuaternion().wxyz().tolist(),
    }


def _path(rows: Sequence[Sequence[float]]) -> list[list[float]]:
    """Returns rows of time and offset in W, dense enough for linear interpolation."""
    if not rows:
        return []
    path = path_trajectory(rows)
    count = 1 + int(np.ceil((path.end_time() - path.start_time()) / _PATH_STEP))
    times = np.linspace(path.start_time(), path.end_time(), count)
    return [[float(time), *path.value(time)[:, 0].tolist()] for time in times]
