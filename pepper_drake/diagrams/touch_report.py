"""Speeds of a simulated robot at contact, and its stopping time, from recorded states."""

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
"""Pairs of shapes farther apart are ignored [m]."""
_REST_SPEED = 0.02
"""Joint speed below which the robot is at rest [rad/s]."""


@dataclass(frozen=True)
class TouchSpeed:
    """Speeds just before contact.

    Attributes:
        relative: Relative speed of the nearest points of link and obstacle [m/s].
        own: Speed of that point of the link [m/s]: the robot's own contribution.
    """

    relative: float
    own: float


def touch_speed(
    station: PepperStation,
    context: Context,
    states: Vector,
    clearance: Vector,
) -> TouchSpeed | None:
    """Returns the speeds at the first contact with an obstacle, from the state before it.

    Args:
        station: The station.
        context: A context of the station, which is changed.
        states: The plant's states (N, positions and velocities).
        clearance: True distance of the robot to obstacles at the same times (N,) [m].

    Returns:
        The speeds; None without contact.
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
    """Returns the velocity in W (3,) [m/s] of a point fixed on a geometry."""
    body = plant.GetBodyFromFrameId(query.inspector().GetFrameId(geometry))
    velocity = plant.EvalBodySpatialVelocityInWorld(context, body)
    p_WC = query.GetPoseInWorld(geometry) @ p_GC
    offset = p_WC - plant.EvalBodyPoseInWorld(context, body).translation()
    return np.asarray(velocity.translational() + np.cross(velocity.rotational(), offset))


def arm_speed(model: ControlModel, arm: str, joint_positions: Vector, time_step: float) -> float:
    """Returns the arm's largest speed relative to the torso in a recorded motion [m/s].

    Args:
        model: Pepper.
        arm: "left" or "right"; its points are the centres of its spheres.
        joint_positions: The arm's joints (N, 5) [rad].
        time_step: Time between them [s].
    """
    if len(joint_positions) < 2:
        return 0.0
    kinematics = arm_kinematics(model, arm)
    centers = kinematics.sphere_centers_at(joint_positions)  # (N, S, 3)
    displacements = np.diff(centers, axis=0)
    return float(np.linalg.norm(displacements, axis=-1).max() / time_step)


def stopping_time(
    times: Vector, joint_commands: Vector, base_poses: Vector, since: float
) -> float | None:
    """Returns the time from an event until the robot stays at rest [s]; None if it never does.

    Args:
        times: (N,) [s], evenly spaced.
        joint_commands: Commands of the joints considered (N, n) [rad].
        base_poses: (N, 3) [m, m, rad].
        since: Time of the event [s].
    """
    step = float(times[1] - times[0])
    speeds = np.abs(np.diff(np.hstack((joint_commands, base_poses)), axis=0)).max(axis=1) / step
    moving = np.flatnonzero(speeds > _REST_SPEED)
    if len(moving) and moving[-1] == len(speeds) - 1:
        return None
    last = float(times[moving[-1] + 1]) if len(moving) else since
    return max(last - since, 0.0)
