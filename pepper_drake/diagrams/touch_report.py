"""Speed and force of a simulated robot's contacts, from its recorded states."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.geometry import GeometryId, QueryObject
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from pepper_drake.diagrams.station import PepperStation
from pepper_drake.models.control_model import ControlModel
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics

Vector = npt.NDArray[np.float64]

_NEAR = 0.1
"""Pairs of shapes farther apart are not looked at [m]."""
_STILL = 0.02
"""A robot whose joints are all slower than this stands [rad/s]."""


@dataclass(frozen=True)
class TouchSpeed:
    """Speeds at the moment before a touch.

    Attributes:
        relative: Speed of the link's nearest point against the obstacle's [m/s].
        own: Speed of that point of the link [m/s]: the robot's part in it.
    """

    relative: float
    own: float


def touch_speed(
    station: PepperStation,
    context: Context,
    states: Vector,
    clearance: Vector,
) -> TouchSpeed | None:
    """Speeds at the first touch of an obstacle, from the state before it.

    Args:
        station: Whose plant it is.
        context: A context of the station, which is changed.
        states: The plant's states (N, positions and velocities).
        clearance: True distance of the robot to obstacles at the same times (N,) [m].

    Returns:
        The speeds; None if nothing was touched.
    """
    touching = np.flatnonzero(clearance <= 0.0)
    if not len(touching):
        return None
    plant = station.plant
    plant_context = station.GetMutableSubsystemContext(plant, context)
    plant.SetPositionsAndVelocities(plant_context, states[max(int(touching[0]) - 1, 0)])
    query: QueryObject = station.GetOutputPort("ground_truth.query").Eval(context)
    robot, obstacles = station.robot_geometries(), station.obstacle_geometries()
    pairs = [
        pair
        for pair in query.ComputeSignedDistancePairwiseClosestPoints(_NEAR)
        if (pair.id_A in robot and pair.id_B in obstacles)
        or (pair.id_B in robot and pair.id_A in obstacles)
    ]
    if not pairs:
        return None
    nearest = min(pairs, key=lambda pair: pair.distance)
    velocities = [
        _point_velocity(plant, plant_context, query, geometry, point)
        for geometry, point in (
            (nearest.id_A, nearest.p_ACa),
            (nearest.id_B, nearest.p_BCb),
        )
    ]
    link = velocities[0 if nearest.id_A in robot else 1]
    relative = velocities[0] - velocities[1]
    return TouchSpeed(float(np.linalg.norm(relative)), float(np.linalg.norm(link)))


def _point_velocity(
    plant: MultibodyPlant,
    context: Context,
    query: QueryObject,
    geometry: GeometryId,
    p_GC: Vector,
) -> Vector:
    """Velocity in W (3,) [m/s] of a point fixed on a geometry."""
    body = plant.GetBodyFromFrameId(query.inspector().GetFrameId(geometry))
    velocity = plant.EvalBodySpatialVelocityInWorld(context, body)
    p_WC = query.GetPoseInWorld(geometry) @ p_GC
    offset = p_WC - plant.EvalBodyPoseInWorld(context, body).translation()
    return np.asarray(velocity.translational() + np.cross(velocity.rotational(), offset))


def arm_speed(model: ControlModel, arm: str, joint_positions: Vector, time_step: float) -> float:
    """Largest speed of the arm's points against the torso on a recorded motion [m/s].

    Args:
        model: Pepper.
        arm: "left" or "right"; the centres of its spheres are the points.
        joint_positions: The arm's joints (N, 5) [rad].
        time_step: Between them [s].
    """
    if len(joint_positions) < 2:
        return 0.0
    kinematics = arm_kinematics(model, arm)
    centers = kinematics.sphere_centers_at(joint_positions)
    ways = np.diff(centers, axis=0)
    return float(np.linalg.norm(ways, axis=-1).max() / time_step)


def stopping_time(
    times: Vector, joint_commands: Vector, base_poses: Vector, since: float
) -> float | None:
    """Time from an event until the robot stands for good [s]; None if it never does.

    Args:
        times: (N,) [s], evenly spaced.
        joint_commands: Of the joints that have to stand (N, n) [rad].
        base_poses: (N, 3) [m, m, rad].
        since: Time of the event [s].
    """
    step = float(times[1] - times[0])
    speeds = np.abs(np.diff(np.hstack((joint_commands, base_poses)), axis=0)).max(axis=1) / step
    moving = np.flatnonzero(speeds > _STILL)
    if len(moving) and moving[-1] == len(speeds) - 1:
        return None
    last = float(times[moving[-1] + 1]) if len(moving) else since
    return max(last - since, 0.0)
