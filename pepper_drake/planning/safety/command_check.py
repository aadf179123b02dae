"""Checks joint commands before they are sent to the robot."""

from enum import IntEnum

import numpy as np
import numpy.typing as npt

from pepper_drake.models.control_model import CommandLimits

Vector = npt.NDArray[np.float64]


class StopReason(IntEnum):
    """Reasons for which the robot is stopped."""

    NONE = 0
    COMMAND_NOT_FINITE = 1
    COMMAND_OUTSIDE_LIMITS = 2
    COMMAND_TOO_FAST = 3
    LINK_TOO_CLOSE = 4
    REQUESTED = 5
    JOINT_HELD = 6
    JOINTS_NOT_MEASURED = 7
    BASE_NOT_MEASURED = 8
    BASE_HELD = 9
    BODY_TOO_CLOSE = 10
    GOAL_NOT_FINITE = 11


STOP_SENTENCES: dict[StopReason, str] = {
    StopReason.NONE: "",
    StopReason.COMMAND_NOT_FINITE: "a joint command was not a finite number",
    StopReason.COMMAND_OUTSIDE_LIMITS: "a joint command was outside its position limits",
    StopReason.COMMAND_TOO_FAST: "a joint command asked for more than the rated velocity",
    StopReason.LINK_TOO_CLOSE: "the arm went too close to an obstacle",
    StopReason.REQUESTED: "the robot was asked to stop",
    StopReason.JOINT_HELD: "a joint did not follow its command: it is stuck, something holds "
    "it, or it is measured late",
    StopReason.JOINTS_NOT_MEASURED: "a joint's encoder gave no number",
    StopReason.BASE_NOT_MEASURED: "the base's odometry gave no number",
    StopReason.BASE_HELD: "the base did not follow its command: it slips, or something holds it",
    StopReason.BODY_TOO_CLOSE: "the robot's body, head or other arm moved too close to an obstacle",
    StopReason.GOAL_NOT_FINITE: "the estimate of the goal's pose was not a number",
}


def stop_sentence(reason: StopReason, joint: str = "") -> str:
    """Returns a sentence about why the robot stopped, with the joint's name if it is known."""
    if joint and reason == StopReason.JOINT_HELD:
        return (
            f"{joint} did not follow its command: it is stuck, something holds it, or it is "
            "measured late"
        )
    if joint and reason == StopReason.JOINTS_NOT_MEASURED:
        return f"the encoder of {joint} gave no number"
    return STOP_SENTENCES[reason]


def check_command(
    command: Vector,
    previous: Vector,
    limits: CommandLimits,
    *,
    time_step: float,
    tolerance: float = 1e-6,
) -> StopReason:
    """Checks a joint command against the one before it.

    Args:
        command: Joint positions (n,) [rad].
        previous: The command of the previous tick (n,) [rad].
        limits: Limits of the same joints.
        time_step: Time between the two [s].
        tolerance: Tolerance of positions [rad].

    Returns:
        `StopReason.NONE` when the command is finite, inside the position limits and no farther
        from the previous one than the velocity limits allow; else that of the first failed check.
    """
    inside = (command >= limits.position_lower - tolerance) & (
        command <= limits.position_upper + tolerance
    )
    if not inside.all():  # Also where a command is not finite.
        finite = np.isfinite(command).all()
        return StopReason.COMMAND_OUTSIDE_LIMITS if finite else StopReason.COMMAND_NOT_FINITE
    if (np.abs(command - previous) > limits.velocity * time_step + tolerance).any():
        return StopReason.COMMAND_TOO_FAST
    return StopReason.NONE
