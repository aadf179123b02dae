"""Fits a movement to a joint path."""

from functools import lru_cache

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RotationMatrix
from scipy.interpolate import make_interp_spline

from pepper_drake.learning import Demonstration, MovementPrimitive
from pepper_drake.learning.cached_times import spline_derivatives
from pepper_drake.learning.dmp.num_basis import DEFAULT_NUM_BASIS
from pepper_drake.models.control_model import arm_joints
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics
from pepper_drake.planning.ik.compiled_tick import quaternions
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams

Vector = npt.NDArray[np.float64]

_SAMPLES = 101
_APPROXIMATOR = "trajectory"
"""Approximator with the least motion after the end, and exact to a tenth of a millimetre."""


def fit_primitive_to_joint_path(
    kinematics: ArmKinematics,
    joints: Vector,
    duration: float,
    name: str,
    rest_fraction: float = ReachPlannerParams.rest_fraction,
) -> MovementPrimitive:
    """Learns a primitive from a joint path as if it had been demonstrated.

    Hand positions, hand orientations and joints (the nominal posture) along the path form a
    demonstration, so that attractor, phase and response to a moving goal are those of any other
    primitive.

    Args:
        kinematics: Kinematics of the arm.
        joints: (N, 5) at even times [rad].
        duration: Duration of the path [s]; the primitive's is longer by the rest at its end.
        name: Name of the primitive.
        rest_fraction: Fraction of the movement for which it rests at its end.
    """
    fine, tau = np.linspace(0.0, 1.0, _SAMPLES), duration / (1.0 - rest_fraction)
    q = _sampling(len(joints), rest_fraction) @ joints
    poses = kinematics.poses(q)
    rates, curvatures = spline_derivatives(fine, poses.hand_position)
    return MovementPrimitive.fit(
        Demonstration.from_positions(
            tau * fine,
            poses.hand_position,
            rates / tau,
            curvatures / tau**2,
            rotations=quaternions(poses.hand_rotation),
            joints=q,
            joint_names=arm_joints(kinematics.arm),
            name=name,
        ),
        approximator=_APPROXIMATOR,
        num_basis=DEFAULT_NUM_BASIS,
        check=False,
    )


@lru_cache(maxsize=16)
def _sampling(count: int, rest_fraction: float) -> Vector:
    """Returns the matrix (_SAMPLES, count) from even samples to those of a spline and a rest."""
    even, fine = np.linspace(0.0, 1.0, count), np.linspace(0.0, 1.0, _SAMPLES)
    spline = make_interp_spline(even, np.eye(count), k=3)
    return np.asarray(spline(np.minimum(fine / (1.0 - rest_fraction), 1.0)))


def reachable_pre_grasp(
    X_OG: RigidTransform, X_TO: RigidTransform, kinematics: ArmKinematics, joints: Vector
) -> RigidTransform:
    """Returns the pre-grasp pose with the hand orientation that a posture gives.

    Args:
        X_OG: The pre-grasp pose, whose position is kept.
        X_TO: The goal object's pose.
        kinematics: Kinematics of the arm.
        joints: Posture at the goal (5,) [rad].
    """
    R_TH = kinematics.poses(joints[None]).hand_rotation[0]
    R_OH = X_TO.rotation().matrix().T @ R_TH
    return RigidTransform(RotationMatrix.ProjectToRotationMatrix(R_OH), X_OG.translation())
