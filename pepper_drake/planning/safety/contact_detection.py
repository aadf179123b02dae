"""Contact detection by comparing measured joints with their commands."""

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
    1.4 rad/s, while other joints accelerate: motors yield to inertia). A joint that is blocked at
    0.5 rad/s is detected after 80 ms, at 0.3 rad/s after 110 ms.
    """

    angle: float = 0.018
    """Largest deviation of a joint at rest from its command [rad]."""
    angle_per_speed: float = 0.004
    """Additional deviation for each rad/s of the command [s]."""
    steps: int = 2
    """Number of successive control periods with a larger deviation that count as contact."""
    give_way_steps: int = 10
    """Control periods after which the command of a stopped robot yields to a deviating joint, and
    those before and in which its answer to the step that tests it is measured."""
    give_way_angle: float = 0.018
    """Step that tests whether something presses on a joint [rad]; more than twice the slack."""
    latency: float = 0.0
    """Largest delay of commands, in addition to the control period [s]."""
    back_off: float = 0.3
    """Time before the contact to whose measured position the joints back off [s]."""
    back_off_speed: float = 0.5
    """Largest joint speed while backing off [rad/s]."""

    def on_worn_robot(self, wear: RobotWear | None) -> "ContactParams":
        """Returns the parameters for a robot with command latency and backlash."""
        if wear is None:
            return self
        return replace(
            self,
            latency=self.latency + wear.command_latency,
            angle=self.angle + 0.5 * float(wear.backlash.max()),
            give_way_angle=self.give_way_angle + 2.0 * float(wear.backlash.max()),
        )


def following_error(commands: Sequence[Vector], measured: Vector) -> Vector:
    """Returns the distance of the measured joints to their recent commands.

    Args:
        commands: Commands (n,) within the latency [rad], at least one.
        measured: Joint positions (n,) [rad].

    Returns:
        Signed distance (n,) to the range of the commands [rad], zero within it.
    """
    lowest = np.minimum.reduce(commands)
    highest = np.maximum.reduce(commands)
    return np.asarray(np.minimum(measured - lowest, 0.0) + np.maximum(measured - highest, 0.0))


def excess_error(error: Vector, velocity: Vector, params: ContactParams) -> Vector:
    """Returns the following error relative to the allowed one (n,): above 1 a joint is held.

    Args:
        error: Following errors (n,) [rad].
        velocity: Velocities of the command (n,) [rad/s].
        params: Allowed errors.
    """
    return np.asarray(np.abs(error) / (params.angle + params.angle_per_speed * np.abs(velocity)))
