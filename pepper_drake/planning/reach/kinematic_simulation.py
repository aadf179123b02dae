"""Kinematic simulation of a movement: the joint commands that the diagram would give for it."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform

from pepper_drake.learning.dmp.point_cloud_distance import PointCloudDistance
from pepper_drake.models.control_model import ControlModel, arm_joints
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics
from pepper_drake.planning.ik.compiled_ik import CompiledIk
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.planning.ik.feedforward import feedforward_poses
from pepper_drake.planning.reach.movement import Movement

Vector = npt.NDArray[np.float64]


class HandPath(NamedTuple):
    """Reference of hand and joints at every time step of a movement.

    Attributes:
        positions: (N, 3) in T [m].
        rotations: (N, 4) unit quaternions w, x, y, z.
        joints: Nominal joint positions (N, 5) [rad].
        ends: Index of the sample at which the motion ends and settling begins.
    """

    positions: Vector
    rotations: Vector
    joints: Vector
    ends: int


class ArmState(NamedTuple):
    """Command of the arm's joints (5,), rad, and its velocity (5,) [rad/s]."""

    position: Vector
    velocity: Vector


class KinematicSimulator:
    """Simulates movements: primitive, coupling, inverse kinematics and command limits.

    Args:
        model: Pepper.
        kinematics: Of the arm.
        ik: Parameters of the inverse kinematics.
        settle: Longest settling time after the end of a motion, in units of tau.
        still_speed: Joint speed below which the arm counts as at rest [rad/s].
    """

    def __init__(
        self,
        model: ControlModel,
        kinematics: ArmKinematics,
        ik: DifferentialIkParams,
        settle: float,
        still_speed: float,
    ) -> None:
        self._kinematics, self._params, self._settle = kinematics, ik, settle
        self._still_speed = still_speed
        self._ik = CompiledIk(model, kinematics.chain, kinematics.arm, ik)
        names = arm_joints(kinematics.arm)
        self.limits = model.command_limits(names, speed_fraction=ik.speed_fraction)
        self.time_step = ik.time_step

    def roll_out(
        self,
        movement: Movement,
        start: ArmState,
        X_TG: RigidTransform,
        field: PointCloudDistance,
    ) -> HandPath:
        """Returns the hand's path from the arm's present state to the goal.

        Args:
            movement: The movement to perform.
            start: Start state of the arm.
            X_TG: The hand's goal.
            field: Distances to the obstacles that the coupling sees, in T.
        """
        X_TH = self._kinematics.hand_pose(start.position)
        velocity = np.zeros(6)
        if start.velocity.any():
            J = self._kinematics.poses(start.position[None]).hand_jacobian()[0]
            velocity = J @ start.velocity
        time_step = self._params.time_step
        path = movement.primitive.rollout(
            time_step=time_step,
            start=X_TH.translation(),
            goal=X_TG.translation(),
            start_velocity=velocity[3:],
            start_angular_velocity=velocity[:3],
            start_rotation=X_TH.rotation().ToQuaternion().wxyz(),
            goal_rotation=X_TG.rotation().ToQuaternion().wxyz(),
            obstacles=None if movement.coupling is None else field,
            coupling="barrier" if movement.coupling is None else movement.coupling,
            settle=self._settle,
        )
        assert path.rotations is not None
        assert path.joints is not None
        ends = len(path.times) - 1 - int(self._settle * movement.primitive.duration / time_step)
        return HandPath(path.positions, path.rotations, path.joints, max(ends, 0))

    def track(self, start: ArmState, path: HandPath, tolerance: float) -> Vector:
        """Returns the joint commands (N, 5) [rad] that the diagram would give along a hand path.

        They end with the path, or once the arm is at rest within half a tolerance [m] of its end.
        """
        p, R = path.positions, path.rotations
        target_p, target_R = feedforward_poses(
            p[:-1], p[1:], R[:-1], R[1:], self._params.tracking_gain
        )
        return self._ik.track(
            start,
            path.joints[:-1],
            target_p,
            target_R,
            limits=self.limits,
            ends=path.ends,
            goal=p[-1],
            tolerance=0.5 * tolerance,
            still_speed=self._still_speed,
        )
