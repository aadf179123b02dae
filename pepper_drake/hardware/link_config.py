"""Configuration of the link to a robot."""

from dataclasses import dataclass

from pepper_drake.hardware.mailbox import CAMERA_NAMES
from pepper_drake.models.control_model import arm_joints
from pepper_drake.models.pepper import JOINT_GROUPS

LATE_CYCLES = 5
"""Cycles in a row without one of ours after which this computer is too slow."""


@dataclass(frozen=True)
class LinkConfig:
    """Configuration of the link to a robot.

    Attributes:
        arm: "left" or "right": this one moves, the other is held by the robot.
        cameras: Those of `CAMERA_NAMES` that may be asked for images.
        camera_rate: Images of each camera [1/s].
        name: Under which the robot lists our subscriptions.
        clock_rate: Rate of the robot's clock; 1 but for a served robot that was told otherwise.
        dead_man: The key that a person holds while the robot moves, as `dead_man_key` takes it.
        protects_arms: Whether the robot slows its arms near what it sees, as it does by itself.
        late_cycles: Cycles in a row that may be left out.
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
