"""Fields common to all demonstration scripts: the arm, and its start posture."""

from copy import deepcopy
from dataclasses import dataclass, field
from pathlib import Path
from typing import Self, TypeVar

import numpy as np

from pepper_drake.errors import InputError
from pepper_drake.models.motion import FARTHEST, LONGEST, check_angles
from pepper_drake.models.pepper import (
    ARMS,
    MODELS_DIR,
    POSTURES,
    mirror_joint_positions,
    posture_positions,
)
from pepper_drake.models.typed_yaml import line_of_field, load_yaml

_SHORTEST = 1e-3

GUIDES_DIR = MODELS_DIR / "guides"


@dataclass
class TeachingScript:
    """A scripted demonstration that starts in a posture."""

    name: str = ""
    description: str = ""
    arm: str = "right"
    posture: str = "stand"  # A name of pepper.POSTURES.
    joints: dict[str, float] = field(default_factory=dict)  # Changes to the posture [rad].
    rest: float = 0.5  # Time at rest before and after the motion [s].

    def check(self) -> None:
        """Raises InputError, in one sentence that names the field, if it makes no sense."""
        if self.arm not in ARMS:
            raise InputError(f'arm is "{self.arm}"; it must be one of {", ".join(ARMS)}')
        if self.posture not in POSTURES:
            raise InputError(
                f'posture is "{self.posture}"; it must be one of {", ".join(POSTURES)}'
            )
        check_angles(self.joints.values(), "joints")
        self.positions()
        if not 0.0 <= self.rest <= LONGEST:
            raise InputError(f"rest is {self.rest:g} s; it must be 0 to {LONGEST:g} s")

    def mirrored(self) -> Self:
        """Returns the script for the other arm, mirrored at the robot's x-z plane."""
        mirror = deepcopy(self)
        mirror.arm = "left" if self.arm == "right" else "right"
        mirror.joints = mirror_joint_positions(self.joints)
        return mirror

    def positions(self) -> dict[str, float]:
        """Returns every joint's position at the start [rad, m]."""
        return posture_positions(self.posture, self.joints)


Script = TypeVar("Script", bound=TeachingScript)


def load_script(schema: type[Script], name_or_path: str | Path, shipped: tuple[str, ...]) -> Script:
    """Loads and checks a script that ships (by its name) or a YAML file.

    Args:
        schema: Class of the script.
        name_or_path: Its name or its file.
        shipped: Names of the shipped scripts.

    Raises:
        InputError: The message names the file, the line and the field.
    """
    path = Path(name_or_path)
    if str(name_or_path) in shipped:
        path = GUIDES_DIR / f"{name_or_path}.yaml"
    elif not path.exists():
        raise InputError(
            f"{path} is neither a guide script nor one that ships: {', '.join(shipped)}"
        )
    script = load_yaml(schema, path)
    try:
        script.check()
    except InputError as error:
        line = line_of_field(path, str(error).split()[0])
        raise InputError(f"{path} line {line}: {error}") from None
    return script


def check_vector(name: str, vector: list[float]) -> None:
    """Raises InputError, naming the field, unless a vector has three finite numbers."""
    if len(vector) != 3 or not np.all(np.abs(vector) <= FARTHEST):
        raise InputError(f"{name} must be three finite numbers of at most {FARTHEST:g}")


def check_duration(name: str, duration: float, *, whole: float = 0.0) -> None:
    """Raises InputError, naming the field, unless a time [s] makes sense.

    Args:
        name: Name of the field.
        duration: Its value; at least a millisecond.
        whole: Sum of all such times [s].
    """
    if not duration >= _SHORTEST:
        raise InputError(f"{name} is {duration:g} s; it must be above 0")
    if not max(duration, whole) <= LONGEST:
        raise InputError(f"{name} makes the script longer than {LONGEST:g} s; shorten it")
