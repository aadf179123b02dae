"""The joints of an arm whose hand follows given ways: many ways at once."""

from functools import lru_cache

import numpy as np
import numpy.typing as npt

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.models.pepper import elbow_roll_limits
from pepper_drake.planning.collision.arm_kinematics import ArmKinematics

Array = npt.NDArray[np.float64]

_ELBOW_YAW, _ELBOW_ROLL = 2, 3
_DAMPING = 0.02
"""Damping of the inverse [m]: it bounds the joints' speed near a stretched arm."""
_POSTURE_GAIN = 3.0
"""Rate [1/s] at which the redundant joints return to the nominal posture."""


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
    damping = _DAMPING**2 * np.eye(3)
    most = limits.velocity * time_step
    for n in range(1, steps):
        poses = kinematics.poses(q)
        J = poses.hand_jacobian()[:, 3:]
        z = nominal[:, n] - nominal[:, n - 1]
        z = z + _POSTURE_GAIN * time_step * (nominal[:, n] - q)
        error = ways[:, n] - poses.hand_position - (J @ z[..., None])[..., 0]
        J_T = J.transpose(0, 2, 1)
        change = z + (J_T @ np.linalg.solve(J @ J_T + damping, error[..., None]))[..., 0]
        change /= np.maximum(1.0, (np.abs(change) / most).max(axis=1))[:, None]
        q = np.clip(q + change, limits.position_lower, limits.position_upper)
        lower, upper = _elbow_limits(kinematics.arm, q[:, _ELBOW_YAW])
        q[:, _ELBOW_ROLL] = np.clip(q[:, _ELBOW_ROLL], lower, upper)
        joints[:, n] = q
    return joints


def _elbow_limits(arm: str, yaws: Array) -> tuple[Array, Array]:
    """Returns an elbow roll's lower and upper limits (S,) at elbow yaws (S,) [rad]."""
    grid, lower, upper = _elbow_table(arm)
    return np.interp(yaws, grid, lower), np.interp(yaws, grid, upper)


@lru_cache(maxsize=2)
def _elbow_table(arm: str) -> tuple[Array, Array, Array]:
    grid = np.linspace(-2.2, 2.2, 441)
    limits = np.array([elbow_roll_limits(float(yaw), arm) for yaw in grid])
    return grid, limits[:, 0], limits[:, 1]
