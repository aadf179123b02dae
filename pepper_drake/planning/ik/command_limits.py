"""From a wished joint velocity to the next joint command that the robot may be given."""

import math

import numpy as np
import numpy.typing as npt

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.models.pepper import elbow_roll_limits

Vector = npt.NDArray[np.float64]

_ELBOW_YAW, _ELBOW_ROLL = 2, 3


def limit_joint_command(
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
        velocity: Present velocity of the command (5,) [rad/s].
        desired_velocity: What the inverse kinematics asks for (5,) [rad/s].
        arm: "left" or "right".
        limits: Of the five joints.
        time_step: s.

    Returns:
        The next command (5,), and its velocity (5,): the difference of the commands over the step.
    """
    # Five joints are treated faster one by one, in plain numbers, than as arrays.
    following = []
    for q, v, wish, top, most, low, high in zip(
        position.tolist(),
        velocity.tolist(),
        desired_velocity.tolist(),
        limits.velocity.tolist(),
        limits.acceleration.tolist(),
        limits.position_lower.tolist(),
        limits.position_upper.tolist(),
        strict=True,
    ):
        change = most * time_step
        wish = min(max(min(max(wish, -top), top), v - change), v + change)
        down = math.sqrt(2.0 * most * max(q - low, 0.0))
        up = math.sqrt(2.0 * most * max(high - q, 0.0))
        following.append(min(max(q + time_step * min(max(wish, -down), up), low), high))
    lower, upper = elbow_roll_limits(following[_ELBOW_YAW], arm)
    following[_ELBOW_ROLL] = min(max(following[_ELBOW_ROLL], lower), upper)
    command = np.array(following)
    return command, (command - position) / time_step
