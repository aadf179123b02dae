"""Guide scripts: how a hand is led through via points, as typed YAML files."""

from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from pepper_drake.errors import InputError
from pepper_drake.models.pepper import (
    ARMS,
    MODELS_DIR,
    POSTURES,
    mirror_joint_positions,
    posture_positions,
)
from pepper_drake.models.typed_yaml import line_of_field, load_yaml

GUIDES_DIR = MODELS_DIR / "guides"
GUIDES = ("reach",)
"""The names of the guide scripts that ship."""


@dataclass
class ViaPoint:
    """A pose of the hand's control frame in the torso frame, and when it is passed."""

    time: float = 0.0  # From the motion's start [s].
    position: list[float] = field(default_factory=list)  # p_TH [m].
    rpy: list[float] = field(default_factory=list)  # R_TH as roll, pitch, yaw [rad].


@dataclass
class GuideScript:
    """A motion of the hand, from where the posture has it through via points to rest."""

    name: str = ""
    description: str = ""
    arm: str = "right"
    posture: str = "stand"  # A name of pepper.POSTURES.
    joints: dict[str, float] = field(default_factory=dict)  # Changes to the posture [rad].
    via_points: list[ViaPoint] = field(default_factory=list)
    rest: float = 0.5  # How long the guide holds still before and after [s].

    def check(self) -> None:
        """Raises InputError, in one sentence that names the field, if it makes no sense."""
        if self.arm not in ARMS:
            raise InputError(f'arm is "{self.arm}"; it must be one of {", ".join(ARMS)}')
        if self.posture not in POSTURES:
            raise InputError(
                f'posture is "{self.posture}"; it must be one of {", ".join(POSTURES)}'
            )
        if not np.all(np.isfinite(list(self.joints.values()))):
            raise InputError("joints must hold finite numbers")
        self.positions()
        if self.rest < 0.0:
            raise InputError(f"rest is {self.rest:g} s; it must not be negative")
        if len(self.via_points) < 2:
            raise InputError(f"via_points holds {len(self.via_points)}; it needs at least two")
        previous = 0.0
        for index, via in enumerate(self.via_points):
            name = f"via_points[{index}]"
            for key, vector in (("position", via.position), ("rpy", via.rpy)):
                if len(vector) != 3 or not np.all(np.isfinite(vector)):
                    raise InputError(f"{name}.{key} must be three finite numbers")
            if not via.time > previous:
                raise InputError(
                    f"{name}.time is {via.time:g} s; times must be above 0 and increase"
                )
            previous = via.time

    def mirrored(self) -> "GuideScript":
        """Returns the script for the other arm, mirrored at the robot's x-z plane."""
        mirror = deepcopy(self)
        mirror.arm = "left" if self.arm == "right" else "right"
        mirror.joints = mirror_joint_positions(self.joints)
        for via in mirror.via_points:
            via.position[1] *= -1
            via.rpy[0::2] = [-angle for angle in via.rpy[0::2]]
        return mirror

    def positions(self) -> dict[str, float]:
        """Returns every joint's position at the start [rad, m]."""
        return posture_positions(self.posture, self.joints)


def load_guide(name_or_path: str | Path) -> GuideScript:
    """Loads and checks a guide script that ships (by its name) or a YAML file.

    Raises:
        InputError: With one sentence that names the file and the field.
    """
    path = Path(name_or_path)
    if str(name_or_path) in GUIDES:
        path = GUIDES_DIR / f"{name_or_path}.yaml"
    elif not path.exists():
        raise InputError(
            f"{path} is neither a guide script nor one that ships: {', '.join(GUIDES)}"
        )
    guide = load_yaml(GuideScript, path)
    try:
        guide.check()
    except InputError as error:
        line = line_of_field(path, str(error).split()[0])
        raise InputError(f"{path} line {line}: {error}") from None
    return guide
