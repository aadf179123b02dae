"""Joint scripts: an arm's joints are dragged one by one; typed YAML files."""

from dataclasses import dataclass, field
from functools import partial
from typing import Self

from pepper_drake.errors import InputError
from pepper_drake.models.motion import check_angles
from pepper_drake.models.pepper import JOINT_GROUPS, arm_group, mirror_joint_positions
from pepper_drake.models.teaching_script import TeachingScript, check_duration, load_script

JOINT_SCRIPTS = ("joints",)
"""The names of the joint scripts that ship."""


@dataclass
class JointMove:
    """One joint is dragged smoothly to an angle while the others are held."""

    joint: str = ""
    angle: float = 0.0  # Final angle [rad].
    duration: float = 1.0  # [s].


@dataclass
class JointScript(TeachingScript):
    """A motion of the arm: its joints dragged one after the other."""

    moves: list[JointMove] = field(default_factory=list)
    pause: float = 0.0  # Time between two moves, for the person to grasp another joint [s].

    def check(self) -> None:
        """Raises InputError, in one sentence that names the field, if it makes no sense."""
        super().check()
        joints = JOINT_GROUPS[arm_group(self.arm)]
        if not self.moves:
            raise InputError("moves holds none; it needs at least one")
        if self.pause < 0.0:
            raise InputError(f"pause is {self.pause:g} s; it must not be negative")
        whole = self.pause * len(self.moves) + sum(move.duration for move in self.moves)
        for index, move in enumerate(self.moves):
            name = f"moves[{index}]"
            if move.joint not in joints:
                raise InputError(
                    f'{name}.joint is "{move.joint}"; the {self.arm} arm has {", ".join(joints)}'
                )
            check_angles([move.angle], f"{name}.angle")
            check_duration(f"{name}.duration", move.duration, whole=whole)

    def mirrored(self) -> Self:
        """Returns the script for the other arm, mirrored at the robot's x-z plane."""
        mirror = super().mirrored()
        for move in mirror.moves:
            ((move.joint, move.angle),) = mirror_joint_positions({move.joint: move.angle}).items()
        return mirror


load_joint_script = partial(load_script, JointScript, shipped=JOINT_SCRIPTS)
"""Loads and checks a joint script that ships (by its name) or a YAML file; see `load_script`."""
