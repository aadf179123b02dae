"""Drawings of a reach in meshcat: the view, the hand's paths, and the cloud."""

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Meshcat, Rgba

from pepper_drake.models.scene import Scene
from pepper_drake.perception.mapping.cloud_points import make_cloud

Vector = npt.NDArray[np.float64]


def frame_view(meshcat: Meshcat, scene: Scene) -> None:
    """Views the goal from the reaching arm's side, without grid and axes."""
    side = 1.0 if scene.arm == "left" else -1.0
    goal = np.array(scene.goal.position)
    meshcat.SetCameraPose(goal + [0.55, 1.35 * side, 0.5], goal + [-0.2, 0.0, -0.05])
    for path in ("/Grid", "/Axes"):
        meshcat.SetProperty(path, "visible", False)


def draw_paths(meshcat: Meshcat, hand_W: Vector, demonstration_W: Vector) -> None:
    """Draws the hand's path in white and the demonstration, from the same start, in black."""
    meshcat.SetLine("demonstration", demonstration_W.T, 3.0, Rgba(0.0, 0.0, 0.0))
    meshcat.SetLine("reproduction", hand_W.T, 4.0, Rgba(1.0, 1.0, 1.0))


def draw_cloud(meshcat: Meshcat, points_W: Vector) -> None:
    """Draws the robot's obstacle cloud as small dots."""
    meshcat.SetObject("cloud", make_cloud(points_W), 0.006, Rgba(0.85, 0.33, 0.1))
