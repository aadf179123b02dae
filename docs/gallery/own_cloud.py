"""A point cloud of one's own: a depth image becomes points, and the movement bends around them."""

import numpy as np
from matplotlib.figure import Figure

from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.perception import CameraIntrinsics


def seen_points() -> np.ndarray:
    """Points (P, 3) [m] of a depth image, as of any camera: a post before a wall."""
    camera = CameraIntrinsics(160, 120, 140.0, 140.0, 79.5, 59.5)
    depth = np.full((camera.height, camera.width), 1.0)
    depth[50:, 74:86] = 0.5
    v, u = np.indices(depth.shape)
    rays = np.stack(
        ((u - camera.center_x) / camera.focal_x, (v - camera.center_y) / camera.focal_y)
    )
    right, down = rays * depth
    return np.stack((depth, -right, -down), axis=-1).reshape(-1, 3)[::3]


def draw() -> Figure:
    """Draws the hand's path as the camera sees it: as shown, and around what the camera saw."""
    share = np.linspace(0.0, 1.0, 201)[:, None]
    smooth = share**3 * (10.0 - 15.0 * share + 6.0 * share**2)
    positions = smooth * [0.0, -0.4, 0.0] + [0.5, 0.2, 0.0]
    primitive = MovementPrimitive.fit(Demonstration.from_positions(2.0 * share[:, 0], positions))
    cloud = seen_points()
    post = cloud[cloud[:, 0] < 0.6]

    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.add_subplot()
    axes.plot(-post[:, 1], post[:, 2], ".", color="0.7", ms=3, label="cloud, without the wall")
    for name, obstacles in (("as shown", None), ("bent by the coupling", cloud)):
        path = primitive.rollout(obstacles=obstacles).positions
        axes.plot(-path[:, 1], path[:, 2], label=name)
    axes.set(xlabel="-y, right [m]", ylabel="z, up [m]", aspect="equal")
    axes.set_title("How does the movement bend around what was seen?")
    axes.legend(loc="lower right", fontsize=8)
    return figure


if __name__ == "__main__":
    draw().savefig("own_cloud.png", dpi=90)
