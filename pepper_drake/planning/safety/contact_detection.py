"""Contact by command against measurement: which joint does not go where it is sent."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from pepper_drake.models.robot_wear import RobotWear

Vector = npt.NDArray[np.float64]


@dataclass(unsafe_hash=True)
class ContactParams:
    """Deviation from its command, and its duration, above which a joint counts as held.

    The defaults are a third above the largest error of free motion in reaches (16 mrad at
    1.4 rad/s, while other joints accelerate: motors give way to inertia). A joint that is held at
    0.5 rad/s is noticed 80 ms later, one at 0.3 rad/s 110 ms.
    """

    angle: float = 0.018
    """Angle off the command that a joint at rest may have [rad]."""
    angle_per_speed: float = 0.004
    """Additional deviation for each rad/s of the command [s]."""
    steps: int = 2
    """For how many control periods in a row it has to be farther off."""
    give_way_steps: int = 10
    """Control periods after which the command of a stopped robot gives way to a joint off it."""
    latency: float = 0.0
    """Time that commands may take to the joints, beside the control period [s]."""
    back_off: float = 0.3
    """Time [s] before the contact to whose position the joints go back."""
    back_off_speed: float = 0.5
    """Largest joint speed on the way back [rad/s]."""

    def on_worn_robot(self, wear: RobotWear | None) -> "ContactParams":
        """Returns the same for a robot whose commands are late and whose joints have slack."""
        if wear is None:
            return self
        return replace(
            self,
            latency=self.latency + wear.command_latency,
            angle=self.angle + 0.5 * float(wear.backlash.max()),
        )


def following_error(commands: Sequence[Vector], measured: Vector) -> Vector:
    """Distance of the measured joints to their recent commands.

    Args:
        commands: Commands (n,) of the time that a command may take to arrive [rad], at least one.
        measured: Joint positions (n,) [rad].

    Returns:
        Signed distance (n,) to the range of the commands [rad], zero within it.
    """
    lowest = np.minimum.reduce(commands)
    highest = np.maximum.reduce(commands)
    return np.asarray(np.minimum(measured - lowest, 0.0) + np.maximum(measured - highest, 0.0))


def excess_error(error: Vector, velocity: Vector, params: ContactParams) -> Vector:
    """Following error as a share of what is allowed (n,): above 1 a joint is held.

    Args:
        error: Following errors (n,) [rad].
        velocity: Velocities of the command (n,) [rad/s].
        params: What is allowed.
    """
    return np.asarray(np.abs(error) / (params.angle + params.angle_per_speed * np.abs(velocity)))
