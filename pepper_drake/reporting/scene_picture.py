"""A picture of the robot in its scene, as seen by a bystander."""

from pathlib import Path

import cv2
import numpy as np
from pydrake.geometry import (
    ClippingRange,
    ColorRenderCamera,
    QueryObject,
    RenderCameraCore,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.sensors import CameraInfo

from pepper_drake.diagrams.reach_run import ReachRun
from pepper_drake.diagrams.station import RENDERER


def look_at(p_WC: np.ndarray, p_WP: np.ndarray) -> RigidTransform:
    """The pose of a camera at p_WC that looks at p_WP with the world's z up."""
    forward = p_WP - p_WC
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    return RigidTransform(RotationMatrix(np.column_stack((right, down, forward))), p_WC)


def save_scene_picture(run: ReachRun, path: Path, *, width: int = 1280, height: int = 800) -> None:
    """Renders the scene as it stands, from the reaching arm's side, into a PNG file."""
    reaching = run.reaching
    query: QueryObject = reaching.GetOutputPort("ground_truth.query").Eval(run.context)
    base = reaching.station.GetOutputPort("base_pose").Eval(
        reaching.station.GetMyContextFromRoot(run.simulator.get_context())
    )
    side = 1.0 if reaching.scene.arm == "left" else -1.0
    turn = np.array([[np.cos(base[2]), -np.sin(base[2])], [np.sin(base[2]), np.cos(base[2])]])
    eye = np.array([*(base[:2] + turn @ [-0.75, side * 1.35]), 1.45])
    target = np.array([*(base[:2] + turn @ [0.22, side * 0.08]), 0.78])
    camera = ColorRenderCamera(
        RenderCameraCore(
            RENDERER,
            CameraInfo(width, height, np.radians(45)),
            ClippingRange(0.05, 20.0),
            RigidTransform(),
        )
    )
    image = query.RenderColorImage(camera, SceneGraph.world_frame_id(), look_at(eye, target))
    cv2.imwrite(str(path), image.data[..., 2::-1])
