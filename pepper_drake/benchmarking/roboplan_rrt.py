"""RoboPlan's RRT-Connect with path shortcutting, over its own model of robot and scene.

RoboPlan is in the `bench` extra and imported only where needed.
"""

from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Box, Capsule, Convex, Cylinder, Shape, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.benchmarking.known_scene import GroundTruthScene
from pepper_drake.models.pepper import JOINT_GROUPS, MODELS_DIR

Array = npt.NDArray[np.float64]

_STEP = 0.05
"""Distance between checks along a motion, RoboPlan's default [rad]."""
_MODEL = MODELS_DIR / "pepper"


def roboplan_rrt(
    known: GroundTruthScene,
    base_pose: Array,
    goals: list[Array],
    *,
    seed: int,
    seconds: float = 5.0,
) -> Array | None:
    """Plans from the arm's start to the first of several postures with a path.

    Args:
        known: The scene.
        base_pose: (3,) x, y, yaw in W.
        goals: Postures (5,) [rad].
        seed: Seed of RoboPlan's random numbers.
        seconds: Time limit of the search for each posture.

    Returns:
        Waypoints (K, 5) of the path after RoboPlan's shortcutting [rad]; None if none was found.
    """
    from roboplan import core, rrt

    scene = roboplan_scene(known, base_pose)
    group = f"{known.scene.arm}_arm"
    names = scene.getJointGroupInfo(group).joint_names
    planner = rrt.RRT(
        scene,
        rrt.RRTOptions(
            group_name=group,
            max_nodes=100_000,
            max_planning_time=seconds,
            collision_check_step_size=_STEP,
            rrt_connect=True,
            fast_return=True,
        ),
    )
    planner.setRngSeed(seed)
    shortcuts = core.PathShortcuttingOptions(group_name=group, max_step_size=_STEP, seed=seed)
    start = core.JointConfiguration(names, known.start)
    for goal in goals:
        try:
            path = planner.plan(start, core.JointConfiguration(names, goal))
        except RuntimeError:  # RoboPlan found no path.
            continue
        corners = np.array(core.PathShortcutter(scene, shortcuts).shortcut(path).positions)
        # RoboPlan does not know the elbow's coupled limit, nor Drake's shape of a mesh.
        if all(known.free(joints, base_pose) for joints in corners):
            return corners
    return None


@lru_cache(maxsize=1)
def roboplan_model(known: GroundTruthScene) -> Any:
    """Returns RoboPlan's model of a scene.

    RoboPlan has neither capsules nor padding: solids are grown by the padding of `known`; a capsule
    becomes the cylinder around it, a mesh the box around it. The collision pairs of the arm's links
    are the same as in Drake's checker.
    """
    from roboplan import core

    scene = core.Scene(
        "pepper",
        core.loadUrdfSceneDescription(str(_MODEL / "pepper_standard.urdf"), [str(MODELS_DIR)]),
    )
    scene.importSrdf((_MODEL / "pepper.srdf").read_text())
    q = scene.getCurrentJointPositions()
    for name, angle in known.scene.robot.positions().items():
        if name not in JOINT_GROUPS["base"]:
            q[scene.getJointPositionIndices([name])] = angle
    scene.setJointPositions(q)
    added: list[str] = []
    for name, shape, _ in known.solids():
        _add(scene, name, shape, known.padding)
        added.append(name)
    # Solids may touch one another, and resting links need no check.
    pairs = [(one, other) for k, one in enumerate(added) for other in added[:k]]
    pairs += [(link, name) for link in known.resting_links() for name in added]
    scene.setCollisions(pairs, False)
    return scene


def roboplan_scene(known: GroundTruthScene, base_pose: Array) -> Any:
    """Returns the model with the solids at their current poses, with the base at the origin."""
    scene = roboplan_model(known)
    x, y, yaw = base_pose
    X_BW = RigidTransform(RollPitchYaw(0.0, 0.0, yaw), [x, y, 0.0]).inverse()
    for name, shape, X_WS in known.solids():
        X_BS = X_BW @ X_WS @ RigidTransform(_middle(shape))
        scene.updateGeometryPlacement(name, "odom", np.asfortranarray(X_BS.GetAsMatrix4()))
    return scene


def _middle(shape: Shape) -> Array:
    """Returns the centre of a mesh's box in the mesh's frame [m]; other shapes: the origin."""
    if not isinstance(shape, Convex):
        return np.zeros(3)
    corners = _corners(shape)
    return (corners.min(axis=0) + corners.max(axis=0)) / 2.0


def _corners(shape: Convex) -> Array:
    hull = shape.GetConvexHull()
    return np.array([hull.vertex(k) for k in range(hull.num_vertices())])


def _add(scene: Any, name: str, shape: Shape, padding: float) -> None:
    """Adds a solid, grown by the padding; `roboplan_scene` sets its pose."""
    from roboplan import core

    color, growth, X = np.array([0.7, 0.6, 0.5, 1.0]), 2.0 * padding, np.asfortranarray(np.eye(4))
    if isinstance(shape, Box):
        box = core.Box(shape.width() + growth, shape.depth() + growth, shape.height() + growth)
        scene.addBoxGeometry(name, "odom", box, X, color)
    elif isinstance(shape, Sphere):
        scene.addSphereGeometry(name, "odom", core.Sphere(shape.radius() + padding), X, color)
    elif isinstance(shape, Cylinder | Capsule):
        round_ends = 2.0 * shape.radius() if isinstance(shape, Capsule) else 0.0
        length = shape.length() + round_ends + growth
        cylinder = core.Cylinder(shape.radius() + padding, length)
        scene.addCylinderGeometry(name, "odom", cylinder, X, color)
    elif isinstance(shape, Convex):
        box = core.Box(*(np.ptp(_corners(shape), axis=0) + growth))
        scene.addBoxGeometry(name, "odom", box, X, color)
    else:
        raise TypeError(f"{name} has a shape that is unknown here: {shape}")
