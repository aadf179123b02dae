"""Guide scripts: a hand is guided through via points; typed YAML files."""

from dataclasses import dataclass, field
from functools import partial
from typing import Self

from pepper_drake.errors import InputError
from pepper_drake.models.motion import check_angles
from pepper_drake.models.teaching_script import (
    TeachingScript,
    check_duration,
    check_vector,
    load_script,
)

GUIDES = ("reach",)
"""The names of the guide scripts that ship."""


@dataclass
class ViaPoint:
    """A pose of the hand's control frame in the torso frame, and its time."""

    time: float = 0.0  # From the motion's start [s].
    position: list[float] = field(default_factory=list)  # p_TH [m].
    rpy: list[float] = field(default_factory=list)  # R_TH as roll, pitch, yaw [rad].

    def mirror(self) -> None:
        """Mirrors the pose in the x-z plane."""
        self.position[1] *= -1
        self.rpy[0::2] = [-angle for angle in self.rpy[0::2]]


@dataclass
class GuideScript(TeachingScript):
    """A motion of the hand from its position in the posture through via points to rest."""

    via_points: list[ViaPoint] = field(default_factory=list)

    def check(self) -> None:
        """Raises InputError, in one sentence that names the field, if it makes no sense."""
        super().check()
        check_via_points(self.via_points)

    def mirrored(self) -> Self:
        """Returns the script for the other arm, mirrored at the robot's x-z plane."""
        mirror = super().mirrored()
        for via in mirror.via_points:
            via.mirror()
        return mirror


def check_via_points(via_points: list[ViaPoint]) -> None:
    """Raises InputError, naming the field `via_points`, if they do not form a path."""
    if len(via_points) < 2:
        raise InputError(f"via_points holds {len(via_points)}; it needs at least two")
    previous = 0.0
    for index, via in enumerate(via_points):
        name = f"via_points[{index}]"
        check_vector(f"{name}.position", via.position)
        check_vector(f"{name}.rpy", via.rpy)
        check_angles(via.rpy, f"{name}.rpy")
        if not via.time > previous:
            raise InputError(f"{name}.time is {via.time:g} s; times must be above 0 and increase")
        check_duration(f"{name}.time", via.time - previous, whole=via.time)
        previous = via.time


load_guide = partial(load_script, GuideScript, shipped=GUIDES)
"""Loads and checks a guide script that ships (by its name) or a YAML file; see `load_script`."""
