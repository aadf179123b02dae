"""Inverse kinematics of the arm for many hand paths at once."""

import numpy as np
import numpy.typing as npt

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics

Array = npt.NDArray[np.float64]

_DAMPING = 0.02
"""Damping of the inverse [m/rad]: it bounds the joint speed near the stretched arm."""
_POSTURE_GAIN = 3.0
"""Rate at which the null-space motion returns to the nominal posture [1/s]."""


def damped_least_squares(J: Array, error: Array, damping: float) -> Array:
    """Returns joint motions J' (J J' + damping² 1)^-1 error (M, 5) [rad] that move the hands.

    Args:
        J: Linear Jacobians (M, 3, 5) of the hands [m/rad].
        error: Displacements of the hands (M, 3) [m].
        damping: Damping, which bounds the motion near the stretched arm [m/rad].
    """
    J_T = J.transpose(0, 2, 1)
    squares = J @ J_T + damping**2 * np.eye(J.shape[1])
    return np.asarray((J_T @ np.linalg.solve(squares, error[..., None]))[..., 0])


def batch_inverse_kinematics(
    kinematics: ArmKinematics,
    limits: CommandLimits,
    hand_paths: Array,
    nominal: Array,
    time_step: float,
) -> Array:
    """Returns joints (S, N, 5) [rad] with which the hand follows paths (S, N, 3) [m] in T.

    Damped least squares for the hand's position; its null space follows the nominal joints:

        z = q_nom' dt + k (q_nom - q) dt,
        dq = z + J' (J J' + damping² 1)^-1 (x_d - x - J z),

    scaled down together where a joint would exceed its velocity limit, and clipped to the position
    limits, including the elbow roll's, which depend on the elbow yaw. The hand's orientation is not
    controlled. This is not the inverse kinematics of the robot's controller, but ten times as fast.

    Args:
        kinematics: Kinematics of the arm.
        limits: Limits of its joints.
        hand_paths: Hand paths (S, N, 3) in T [m].
        nominal: Nominal joints (S, N, 5), whose first are the start [rad].
        time_step: Time between samples [s].
    """
    count, steps, _ = hand_paths.shape
    joints = np.empty((count, steps, 5))
    q = np.clip(nominal[:, 0], limits.position_lower, limits.position_upper)
    joints[:, 0] = q
    largest = limits.velocity * time_step
    for n in range(1, steps):
        poses = kinematics.poses(q)
        J = poses.hand_jacobian()[:, 3:]
        z = nominal[:, n] - nominal[:, n - 1]
        z = z + _POSTURE_GAIN * time_step * (nominal[:, n] - q)
        error = hand_paths[:, n] - poses.hand_position - (J @ z[..., None])[..., 0]
        change = z + damped_least_squares(J, error, _DAMPING)
        change /= np.maximum(1.0, (np.abs(change) / largest).max(axis=1))[:, None]
        q = np.clip(q + change, limits.position_lower, limits.position_upper)
        for pair in limits.coupled:
            leader = q[:, pair.leader]
            lower, upper = (np.interp(leader, pair.positions, y) for y in (pair.lower, pair.upper))
            q[:, pair.follower] = np.clip(q[:, pair.follower], lower, upper)
        joints[:, n] = q
    return joints
