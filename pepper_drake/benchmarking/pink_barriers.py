"""Pink's differential inverse kinematics with its collision barriers, from the true scene.

Pink (Caron et al.) is in the `bench` extra, with the QP solver DAQP; both are imported only where
needed. It is a reactive policy without planning, and stops where the goal task and the barriers
balance.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.geometry import Box, Capsule, Convex, Cylinder, Shape, Sphere
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.benchmarking.known_scene import GroundTruthScene
from pepper_drake.models.control_model import arm_joints, shared_control_model
from pepper_drake.models.pepper import JOINT_GROUPS, MODELS_DIR, hand_frame
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams

Array = npt.NDArray[np.float64]

_MODEL = MODELS_DIR / "pepper"
_NEAREST = 12
"""Number of closest pairs with a barrier in each step."""
_GAIN, _SAFE_GAIN = 10.0, 1.0
_POSITION_COST, _ORIENTATION_COST, _TASK_GAIN = 10.0, 0.1, 0.05
"""Weights of the hand's task; position has priority, as five joints cannot reach every pose."""
_LONGEST = 6.0
"""Longest motion [s]."""
_ARRIVED = 0.002
"""Distance to the goal at which the motion ends [m]."""


def barrier_motion(known: GroundTruthScene, base_pose: Array, time_step: float = 0.01) -> Array:
    """Returns joints (N, 5) at each time step from the arm's start towards the goal [rad].

    Args:
        known: The scene, as it is now.
        base_pose: (3,) x, y, yaw in W.
        time_step: Time step [s].

    Returns:
        The motion, which ends at the goal, where the arm stops, or where the QP has no solution.
    """
    import pink
    import pinocchio as pin

    model, geometry = pinocchio_models(known, base_pose)
    data, geometry_data = model.createData(), pin.GeometryData(geometry)
    X_BW = _base(base_pose).inverse()
    goal = pin.SE3((X_BW @ known.X_WG).GetAsMatrix4())
    task = pink.tasks.FrameTask(
        hand_frame(known.scene.arm), _POSITION_COST, _ORIENTATION_COST, gain=_TASK_GAIN
    )
    task.set_target(goal)
    barrier = pink.barriers.SelfCollisionBarrier(
        min(_NEAREST, len(geometry.collisionPairs)),
        gain=_GAIN,
        safe_displacement_gain=_SAFE_GAIN,
        d_min=known.padding,
    )
    path = [known.start]
    for _ in range(round(_LONGEST / time_step)):
        configuration = pink.Configuration(
            model, data, path[-1], collision_model=geometry, collision_data=geometry_data
        )
        try:
            velocity = pink.solve_ik(
                configuration,
                [task],
                time_step,
                solver="daqp",
                barriers=[barrier],
                safety_break=False,
            )
        except pink.exceptions.NoSolutionFound:
            break
        path.append(pin.integrate(model, path[-1], velocity * time_step))
        hand = configuration.get_transform_frame_to_world(hand_frame(known.scene.arm))
        near = np.linalg.norm(hand.translation - goal.translation) < _ARRIVED
        if near or np.abs(velocity).max() < 1e-4:
            break
    return np.array(path)


def _base(base_pose: Array) -> RigidTransform:
    x, y, yaw = base_pose
    return RigidTransform(RollPitchYaw(0.0, 0.0, yaw), [x, y, 0.0])


def pinocchio_models(known: GroundTruthScene, base_pose: Array) -> tuple[Any, Any]:
    """Returns Pinocchio's model of the arm, with the base at the origin, and of all shapes."""
    import pinocchio as pin

    arm = arm_joints(known.scene.arm)
    urdf = str(_MODEL / "pepper_standard.urdf")
    whole = pin.buildModelFromUrdf(urdf)
    shapes = pin.buildGeomFromUrdf(whole, urdf, pin.GeometryType.COLLISION)
    q = pin.neutral(whole)
    for name, angle in known.scene.robot.positions().items():
        if name not in JOINT_GROUPS["base"]:
            q[whole.joints[whole.getJointId(name)].idx_q] = angle
    locked = [whole.getJointId(n) for n in whole.names[1:] if n not in arm]
    model, geometry = pin.buildReducedModel(whole, shapes, locked, q)
    limits = shared_control_model().command_limits(
        arm, speed_fraction=DifferentialIkParams().speed_fraction
    )
    model.velocityLimit = limits.velocity
    moving = [k for k, g in enumerate(geometry.geometryObjects) if g.parentJoint > 0]
    for name, shape, X_WS in known.solids():
        X_BS = _base(base_pose).inverse() @ X_WS
        solid = pin.GeometryObject(name, 0, 0, pin.SE3(X_BS.GetAsMatrix4()), _coal(shape))
        number = geometry.addGeometryObject(solid)
        for link in moving:
            geometry.addCollisionPair(pin.CollisionPair(link, number))
    resting = set(known.resting_links())
    for link in moving:
        for k, other in enumerate(geometry.geometryObjects):
            body = other.name.rpartition("_")[0]
            if body in resting and k not in moving and "Shoulder" not in body:
                geometry.addCollisionPair(pin.CollisionPair(link, k))
    pin.removeCollisionPairs(model, geometry, str(_MODEL / "pepper.srdf"))
    return model, geometry


def _coal(shape: Shape) -> Any:
    """Returns a shape for Pinocchio; for a mesh, its convex hull."""
    import coal

    if isinstance(shape, Box):
        return coal.Box(shape.width(), shape.depth(), shape.height())
    if isinstance(shape, Sphere):
        return coal.Sphere(shape.radius())
    if isinstance(shape, Cylinder):
        return coal.Cylinder(shape.radius(), shape.length())
    if isinstance(shape, Capsule):
        return coal.Capsule(shape.radius(), shape.length())
    assert isinstance(shape, Convex)
    hull = shape.GetConvexHull()
    points = coal.StdVec_Vec3s()
    for k in range(hull.num_vertices()):
        points.append(hull.vertex(k))
    return coal.Convex.convexHull(points, True, "Qt")
