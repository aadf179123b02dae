"""The joints of an arm whose hand follows given ways: many ways at once."""

import numpy as np
import numpy.typing as npt

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics

Array = npt.NDArray[np.float64]

_DAMPING = 0.02
"""Damping of the inverse [m]: it bounds the joints' speed near a stretched arm."""
_POSTURE_GAIN = 3.0
"""Rate [1/s] at which the redundant joints return to the nominal posture."""


def damped_least_squares(J: Array, error: Array, damping: float) -> Array:
    """Returns joint motions (M, 5) [rad] that move hands by (M, 3) [m]: J' (J J' + damping² 1)^-1.

    Args:
        J: (M, 3, 5) the hands' linear velocity per joint velocity [m/rad].
        error: (M, 3) [m].
        damping: It bounds the motion near a stretched arm [m/rad].
    """
    J_T = J.transpose(0, 2, 1)
    squares = J @ J_T + damping**2 * np.eye(J.shape[1])
    return np.asarray((J_T @ np.linalg.solve(squares, error[..., None]))[..., 0])


def batch_inverse_kinematics(
    kinematics: ArmKinematics,
    limits: CommandLimits,
    ways: Array,
    nominal: Array,
    time_step: float,
) -> Array:
    """Returns joints (S, N, 5) [rad] with which hands follow ways (S, N, 3) [m] in T.

    Damped least squares for the hand's position; the two spare joints follow the nominal ones:

        z = q_nom' dt + k (q_nom - q) dt,
        dq = z + J' (J J' + damping² 1)^-1 (x_d - x - J z),

    scaled down together where one would be faster than its limit, and kept inside the position
    limits, those of the elbow's roll among them, which its yaw moves. The hand's direction is that
    of the posture. It is not the robot's own inverse kinematics, but ten times as fast.

    Args:
        kinematics: Of the arm.
        limits: Of its joints.
        ways: Where the hands are to be.
        nominal: (S, N, 5) the joints to stay near; where they start.
        time_step: Between samples [s].
    """
    count, steps, _ = ways.shape
    joints = np.empty((count, steps, 5))
    q = np.clip(nominal[:, 0], limits.position_lower, limits.position_upper)
    joints[:, 0] = q
    most = limits.velocity * time_step
    for n in range(1, steps):
        poses = kinematics.poses(q)
        J = poses.hand_jacobian()[:, 3:]
        z = nominal[:, n] - nominal[:, n - 1]
        z = z + _POSTURE_GAIN * time_step * (nominal[:, n] - q)
        error = ways[:, n] - poses.hand_position - (J @ z[..., None])[..., 0]
        change = z + damped_least_squares(J, error, _DAMPING)
        change /= np.maximum(1.0, (np.abs(change) / most).max(axis=1))[:, None]
        q = np.clip(q + change, limits.position_lower, limits.position_upper)
        for one in limits.coupled:
            lower, upper = (
                np.interp(q[:, one.leader], one.positions, ends) for ends in (one.lower, one.upper)
            )
            q[:, one.follower] = np.clip(q[:, one.follower], lower, upper)
        joints[:, n] = q
    return joints
