"""Configuration of the link to a robot."""

from dataclasses import dataclass

from pepper_drake.hardware.mailbox import CAMERA_NAMES
from pepper_drake.models.control_model import arm_joints
from pepper_drake.models.pepper import JOINT_GROUPS

LATE_CYCLES = 5
"""Consecutive late cycles after which this computer is too slow."""


@dataclass(frozen=True)
class LinkConfig:
    """Configuration of the link to a robot.

    Attributes:
        arm: "left" or "right": the one that moves; the other is held by the robot.
        cameras: Those of `CAMERA_NAMES` that may be read.
        camera_rate: Of each camera's images [1/s].
        name: Of our subscriptions in the robot.
        clock_rate: Rate of the robot's clock; 1 except for a served robot with another rate.
        dead_man: The key to hold while the robot moves, as for `dead_man_key`.
        protects_arms: Whether the robot's own protection slows its arms near obstacles.
        late_cycles: Tolerated consecutive late cycles.
    """

    arm: str
    cameras: tuple[str, ...] = CAMERA_NAMES
    camera_rate: float = 5.0
    name: str = "pepper_drake"
    clock_rate: float = 1.0
    dead_man: str = ""
    protects_arms: bool = True
    late_cycles: int = LATE_CYCLES

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints that are commanded."""
        return (*JOINT_GROUPS["head"], *arm_joints(self.arm))
