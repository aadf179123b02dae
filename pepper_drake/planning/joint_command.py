"""From a wished joint velocity to the next joint command that the robot may be given."""

import numpy as np
import numpy.typing as npt

from pepper_drake.models.pepper import elbow_roll_limits
from pepper_drake.planning.control_model import CommandLimits

Vector = npt.NDArray[np.float64]

_ELBOW_YAW, _ELBOW_ROLL = 2, 3


def step_arm_command(
    position: Vector,
    velocity: Vector,
    desired_velocity: Vector,
    *,
    arm: str,
    limits: CommandLimits,
    time_step: float,
) -> tuple[Vector, Vector]:
    """Moves an arm's joint command by one step, inside every limit.

    The desired velocity is kept within the velocity limits, within the acceleration limits about
    the present velocity, and slow enough to brake before a position limit,
    |v| <= sqrt(2 a d) at a distance d; then it is integrated, and the elbow's roll is kept inside
    the range that its yaw allows.

    Args:
        position: Present command (5,), rad, shoulder to wrist.
        velocity: Present velocity of the command (5,), rad/s.
        desired_velocity: What the inverse kinematics asks for (5,), rad/s.
        arm: "left" or "right".
        limits: Of the five joints.
        time_step: s.

    Returns:
        The next command (5,), and its velocity (5,): the difference of the commands over the step.
    """
    limit = limits.velocity
    change = limits.acceleration * time_step
    # Minima and maxima of numpy's, which cost a fifth of its clip for so few numbers.
    wish = np.minimum(np.maximum(desired_velocity, -limit), limit)
    wish = np.minimum(np.maximum(wish, velocity - change), velocity + change)
    braking = 2.0 * limits.acceleration
    up = np.sqrt(braking * np.maximum(limits.position_upper - position, 0.0))
    down = np.sqrt(braking * np.maximum(position - limits.position_lower, 0.0))
    wish = np.minimum(np.maximum(wish, -down), up)
    following = position + time_step * wish
    following = np.minimum(np.maximum(following, limits.position_lower), limits.position_upper)
    lower, upper = elbow_roll_limits(following[_ELBOW_YAW], arm)
    following[_ELBOW_ROLL] = min(max(following[_ELBOW_ROLL], lower), upper)
    return following, (following - position) / time_step
