"""Something that moves over a scene's table while Pepper reaches: an arm, a ball, a bottle.

It comes near the hand's goal, at up to 0.3 m/s. Nobody could be asked to avoid what runs over the
robot's body or through the very place where the arm is to end, so it does neither: it stays over
the table, and off the hand's goal and the forearm behind it. Whether there is a way, or time to
wait, for the arm to get there is not its business.
"""

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.errors import InputError
from pepper_drake.models.scene import Obstacle, Scene
from pepper_drake.models.shapes import distances

Array = npt.NDArray[np.float64]

FASTEST = 0.3
"""[m/s]"""

_KINDS = ("person_arm", "rolling_ball", "rolling_bottle")
_SKIN = [0.87, 0.67, 0.55, 1.0]
_ARM = 0.5
_BOTTLE = 0.2
"""Their lengths [m]; of the arm, without its round ends."""
_LIFT = 0.001
"""Between what rolls and the table [m]."""
_GAP = 0.015
"""Least distance to what stands on the table [m]."""
_FREE = 0.11
"""What is left free about the hand's goal and the forearm behind it [m]."""
_FOREARM = 0.22
_FARTHEST = 0.10
"""It comes at least so near to what is left free [m]."""
_MAX_TRIES = 1000
"""For each kind of thing."""


def moving_obstacle(scene: Scene, rng: np.random.Generator) -> Obstacle:
    """Draws an obstacle with a path that fits into a random scene.

    Args:
        scene: A table, things on it and a goal; its robot faces the table's edge along +x.
        rng: What draws.

    Returns:
        The obstacle; the times of its path count from when the arm starts.
    """
    top = next(o for o in scene.obstacles if o.name == "table_top")
    near = [o for o in scene.solids() if o.name != "table_top" and "leg" not in o.name]
    final = _arm_at_goal(scene)
    for kind in rng.permutation(_KINDS):
        for _ in range(_MAX_TRIES):
            obstacle = _draw(str(kind), scene, rng)
            poses = _poses(obstacle)
            axis = _axis(obstacle, poses)
            if (
                _over_table(obstacle, axis, top)
                and 0.0 <= _distance(axis, *final) - _FREE - obstacle.size[0] <= _FARTHEST
                and distances(obstacle.solid(), poses, near).min() >= _GAP
            ):
                return obstacle
    raise InputError(f"{scene.name}: the table is too full for anything to move over it")


def _arm_at_goal(scene: Scene) -> tuple[Array, Array]:
    """The hand at its goal, and the forearm's other end, in the world [m]."""
    hand = (scene.goal.pose() @ scene.pre_grasp()).translation()
    side = 1.0 if scene.arm == "left" else -1.0
    # The elbow is nearer to the robot, and on the arm's side.
    return hand, hand + _FOREARM * np.array([-1.0, 0.4 * side, 0.0]) / np.hypot(1.0, 0.4)


def _axis(obstacle: Obstacle, poses: list[RigidTransform]) -> Array:
    """Points (N, 7, 3) on its axis along its way; a ball's are all its centre."""
    half = obstacle.size[1] / 2 if len(obstacle.size) > 1 else 0.0
    along = np.linspace([0.0, 0.0, -half], [0.0, 0.0, half], 7)
    return np.array([along @ X.rotation().matrix().T + X.translation() for X in poses])


def _distance(points: Array, one: Array, other: Array) -> float:
    """The least distance of points (..., 3) to the line between two [m]."""
    line = other - one
    share = np.clip((points - one) @ line / (line @ line), 0.0, 1.0)
    return float(np.linalg.norm(points - one - share[..., None] * line, axis=-1).min())


def _draw(kind: str, scene: Scene, rng: np.random.Generator) -> Obstacle:
    """Draws a thing and its way."""
    height = scene.goal.position[2]
    heading = float(rng.uniform(-np.pi, np.pi))
    along = np.array([np.cos(heading), np.sin(heading)])
    end = np.array(scene.goal.position[:2]) + rng.uniform(-0.45, 0.45, 2)
    distance = float(rng.uniform(0.2, 0.5))
    start = end - along * distance
    radius = float(rng.uniform(0.03, 0.05))
    color = [*(round(float(c), 3) for c in rng.uniform(0.15, 0.85, 3)), 1.0]
    obstacle = Obstacle(name=kind, color=color)
    z = height + radius + _LIFT
    if kind == "person_arm":
        obstacle.shape, obstacle.size, obstacle.color = "capsule", [radius, _ARM], list(_SKIN)
        obstacle.rpy = [0.0, np.pi / 2, heading]
        z = height + radius + float(rng.uniform(0.01, 0.20))
        start -= along * _ARM / 2  # Its fingers come to the end of the way; the rest is behind.
    elif kind == "rolling_ball":
        obstacle.shape, obstacle.size = "sphere", [radius]
    else:
        obstacle.shape, obstacle.size = "cylinder", [radius, _BOTTLE]
        obstacle.rpy = [0.0, np.pi / 2, heading + np.pi / 2]  # It lies across its way.
    obstacle.size = [round(float(v), 4) for v in obstacle.size]
    obstacle.rpy = [round(float(v), 4) for v in obstacle.rpy]
    obstacle.position = [round(float(v), 4) for v in (*start, z)]
    obstacle.path = _way(along * distance, returns=kind == "person_arm", rng=rng)
    return obstacle


def _way(offset: Array, *, returns: bool, rng: np.random.Generator) -> list[list[float]]:
    """Rows of time and offset: there, and half of what can come back does so."""
    # A smooth step is one and a half times as fast in its middle as on average.
    peak = float(rng.uniform(0.1, FASTEST))
    duration = 1.5 * float(np.linalg.norm(offset)) / peak
    begin = float(rng.uniform(0.0, 1.5))
    there = [round(float(v), 4) for v in (*offset, 0.0)]
    rows = [[begin, 0.0, 0.0, 0.0], [begin + duration, *there]]
    if returns and rng.random() < 0.5:
        rest = begin + duration + float(rng.uniform(0.3, 1.5))
        rows += [[rest, *there], [rest + duration, 0.0, 0.0, 0.0]]
    return [[round(row[0], 3), *row[1:]] for row in rows]


def _poses(obstacle: Obstacle, count: int = 12) -> list[RigidTransform]:
    """Where it is along its straight way."""
    X, offset = obstacle.pose(), np.array(obstacle.path[1][1:])
    return [
        RigidTransform(X.rotation(), X.translation() + share * offset)
        for share in np.linspace(0.0, 1.0, count)
    ]


def _over_table(obstacle: Obstacle, axis: Array, top: Obstacle) -> bool:
    """Whether it never comes to the robot's side of the edge, and what rolls stays on the table."""
    radius = obstacle.size[0]
    low = np.array(top.position[:2]) - np.array(top.size[:2]) / 2 + radius
    high = np.array(top.position[:2]) + np.array(top.size[:2]) / 2 - radius
    if obstacle.shape == "capsule":
        return bool(np.all(axis[..., 0] >= low[0]))
    return bool(np.all((axis[..., :2] >= low) & (axis[..., :2] <= high)))
