"""An obstacle that moves over a scene's table while Pepper reaches: an arm, a ball, a bottle.

It comes near the arm's pose at the goal, at up to 0.3 m/s. In half of the scenes it passes beside
that place; in the others a person's arm reaches into it, before Pepper's arrives, and withdraws, so
that a waiting robot can reach. As no robot could avoid an obstacle that runs over its body or into
its arm, it stays over the table and comes early. Whether a path or time to wait exists is not
checked.
"""

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.errors import InputError
from pepper_drake.models.scene import Obstacle, Scene
from pepper_drake.models.shapes import distances

Array = npt.NDArray[np.float64]

FASTEST = 0.3
"""Largest speed [m/s]."""

_KINDS = ("person_arm", "rolling_ball", "rolling_bottle")
_SKIN = [0.87, 0.67, 0.55, 1.0]
_ARM = 0.5
_BOTTLE = 0.2
"""Their lengths [m]; the arm's without its round ends."""
_LIFT = 0.001
"""Gap between a rolling object and the table [m]."""
_GAP = 0.015
"""Smallest distance to objects on the table [m]."""
_FREE = 0.11
"""Radius of the space reserved for the arm, around the hand's goal and the forearm [m]."""
_FOREARM = 0.22
_FARTHEST = 0.10
"""Largest distance at which it passes the reserved space [m]."""
_EARLY = 1.6
"""Earliest time at which an arm arrives at its goal [s]."""
_MAX_TRIES = 1000
"""Number of draws for each kind of object."""


def moving_obstacle(scene: Scene, rng: np.random.Generator) -> Obstacle:
    """Draws an obstacle with a path that fits into a random scene.

    Args:
        scene: A table with objects and a goal; its robot faces the table's edge along +x.
        rng: Random number generator.

    Returns:
        The obstacle; the times of its path count from when the arm starts.
    """
    top = next(o for o in scene.obstacles if o.name == "table_top")
    near = [o for o in scene.solids() if o.name != "table_top" and "leg" not in o.name]
    final = _arm_at_goal(scene)
    plans = [(str(kind), False) for kind in rng.permutation(_KINDS)]
    if rng.random() < 0.5:
        plans.insert(0, ("person_arm", True))
    for kind, into in plans:
        for _ in range(_MAX_TRIES):
            obstacle = _draw(kind, scene, rng, into=into)
            times, poses = _outward_motion(obstacle)
            axis = _axis(obstacle, poses)
            if not _over_table(obstacle, axis, top):
                continue
            gaps = _distances(axis, *final) - _FREE - obstacle.size[0]
            fits = _reaches_into(times, gaps) if into else _passes_by(gaps)
            if fits and distances(obstacle.solid(), poses, near).min() >= _GAP:
                return obstacle
    raise InputError(f"{scene.name}: the table is too full for anything to move over it")


def _passes_by(gaps: Array) -> bool:
    """True if the obstacle comes near the space reserved for the arm, but not into it."""
    return bool(0.0 <= gaps.min() <= _FARTHEST)


def _reaches_into(times: Array, gaps: Array) -> bool:
    """True if the obstacle starts outside the reserved space and soon comes well into it."""
    return bool(
        gaps[0] >= _FARTHEST / 2
        and gaps.min() <= -_FREE / 2
        and times[int(np.argmax(gaps < 0.0))] <= _EARLY
    )


def _arm_at_goal(scene: Scene) -> tuple[Array, Array]:
    """Returns the hand's goal position, and the elbow end of the forearm, in W [m]."""
    hand = (scene.goal.pose() @ scene.pre_grasp()).translation()
    side = 1.0 if scene.arm == "left" else -1.0
    # The elbow is closer to the robot, on the arm's side.
    return hand, hand + _FOREARM * np.array([-1.0, 0.4 * side, 0.0]) / np.hypot(1.0, 0.4)


def _axis(obstacle: Obstacle, poses: list[RigidTransform]) -> Array:
    """Returns points (N, 7, 3) on its axis at N poses; a ball's are all its centre."""
    half = obstacle.size[1] / 2 if len(obstacle.size) > 1 else 0.0
    along = np.linspace([0.0, 0.0, -half], [0.0, 0.0, half], 7)
    return np.array([along @ X.rotation().matrix().T + X.translation() for X in poses])


def _distances(points: Array, one: Array, other: Array) -> Array:
    """Returns the smallest distances (N,) of points (N, M, 3) to the segment of two others [m]."""
    line = other - one
    share = np.clip((points - one) @ line / (line @ line), 0.0, 1.0)
    return np.linalg.norm(points - one - share[..., None] * line, axis=-1).min(axis=1)


def _draw(kind: str, scene: Scene, rng: np.random.Generator, *, into: bool) -> Obstacle:
    """Draws an obstacle and its path."""
    height = scene.goal.position[2]
    heading = float(rng.uniform(-np.pi, np.pi))
    along = np.array([np.cos(heading), np.sin(heading)])
    spread = 0.1 if into else 0.45
    end = _arm_at_goal(scene)[0][:2] + rng.uniform(-spread, spread, 2)
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
        start -= along * _ARM / 2  # The fingertips, not the centre, reach the end of the path.
    elif kind == "rolling_ball":
        obstacle.shape, obstacle.size = "sphere", [radius]
    else:
        obstacle.shape, obstacle.size = "cylinder", [radius, _BOTTLE]
        obstacle.rpy = [0.0, np.pi / 2, heading + np.pi / 2]  # Its axis is across the path.
    obstacle.size = [round(float(v), 4) for v in obstacle.size]
    obstacle.rpy = [round(float(v), 4) for v in obstacle.rpy]
    obstacle.position = [round(float(v), 4) for v in (*start, z)]
    # The peak speed of a smooth step is 1.5 times its average.
    duration = 1.5 * distance / float(rng.uniform(0.15, FASTEST))
    begin = float(rng.uniform(0.0, 0.4 if into else 1.5))
    there = [round(float(v), 4) for v in (*along * distance, 0.0)]
    rows = [[begin, 0.0, 0.0, 0.0], [begin + duration, *there]]
    if kind == "person_arm" and (into or rng.random() < 0.5):
        back = begin + duration + float(rng.uniform(0.3, 1.5))
        rows += [[back, *there], [back + duration, 0.0, 0.0, 0.0]]
    obstacle.path = [[round(row[0], 3), *row[1:]] for row in rows]
    return obstacle


def _outward_motion(obstacle: Obstacle, count: int = 16) -> tuple[Array, list[RigidTransform]]:
    """Returns times (N,) [s] and poses of its straight motion there; it returns the same way."""
    X, (begin, *_), (end, *offset) = obstacle.pose(), *obstacle.path[:2]
    share = np.linspace(0.0, 1.0, count)
    smooth = share**2 * (3.0 - 2.0 * share)
    positions = X.translation() + smooth[:, None] * np.array(offset)
    return begin + share * (end - begin), [RigidTransform(X.rotation(), p) for p in positions]


def _over_table(obstacle: Obstacle, axis: Array, top: Obstacle) -> bool:
    """Tells whether it stays beyond the table's edge, and on the table if it rolls."""
    radius = obstacle.size[0]
    low = np.array(top.position[:2]) - np.array(top.size[:2]) / 2 + radius
    high = np.array(top.position[:2]) + np.array(top.size[:2]) / 2 - radius
    if obstacle.shape == "capsule":
        return bool(np.all(axis[..., 0] >= low[0]))
    return bool(np.all((axis[..., :2] >= low) & (axis[..., :2] <= high)))
