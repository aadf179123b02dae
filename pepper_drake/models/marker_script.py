"""Marker scripts: a person moves a marker in front of the robot; typed YAML files."""

from dataclasses import dataclass, field
from functools import partial
from typing import Self

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from pepper_drake.errors import InputError
from pepper_drake.models.guide import ViaPoint
from pepper_drake.models.motion import check_angles
from pepper_drake.models.teaching_script import (
    TeachingScript,
    check_duration,
    check_vector,
    load_script,
)

MARKER_SCRIPTS = ("marker",)
"""The names of the marker scripts that ship."""

CAMERAS = ("top", "bottom")

FACING = RollPitchYaw(np.pi / 2, 0.0, -np.pi / 2).ToRotationMatrix()
"""R_TM of an upright marker that faces the robot: x to the robot's left, y up, z towards it."""


@dataclass
class MarkerScript(TeachingScript):
    """A person opposite the robot moves a marker, which is seen by a camera of the head.

    The map from the person's workspace to the arm's is explicit: see `WorkspaceMap`.
    """

    camera: str = "top"  # The head's camera that is used.
    period: float = 0.1  # Time between two images [s].
    marker_id: int = 11  # In DICT_4X4_50.
    marker_size: float = 0.08  # Edge of the black square [m].
    scale: float = 0.6  # Ratio of the arm's motion to the person's: that of their arm lengths.
    yaw: float = np.pi  # From the person's axes to the robot's, about z [rad]; pi: face to face.
    # The marker's trajectory: its centre in T [m], and its rotation from facing the robot.
    path: list[ViaPoint] = field(default_factory=list)

    def check(self) -> None:
        """Raises InputError, in one sentence that names the field, if it makes no sense."""
        super().check()
        if self.camera not in CAMERAS:
            raise InputError(f'camera is "{self.camera}"; it must be one of {", ".join(CAMERAS)}')
        if not 0 <= self.marker_id < 50:
            raise InputError(f"marker_id is {self.marker_id}; DICT_4X4_50 has 0 to 49")
        limits = {"period": (0.01, 10.0), "marker_size": (0.005, 0.5), "scale": (0.01, 10.0)}
        for name, (lower, upper) in limits.items():
            value = getattr(self, name)
            if not value > 0.0:
                raise InputError(f"{name} is {value:g}; it must be above 0")
            if not lower <= value <= upper:
                raise InputError(f"{name} is {value:g}; it must be {lower:g} to {upper:g}")
        check_angles([self.yaw], "yaw")
        if len(self.path) < 3:
            raise InputError(f"path holds {len(self.path)} poses; it needs at least three")
        if self.path[0].time != 0.0:
            raise InputError(f"path[0].time is {self.path[0].time:g} s; it must be 0")
        for index, via in enumerate(self.path):
            check_vector(f"path[{index}].position", via.position)
            check_vector(f"path[{index}].rpy", via.rpy)
            check_angles(via.rpy, f"path[{index}].rpy")
            if index and not via.time > self.path[index - 1].time:
                raise InputError(f"path[{index}].time is {via.time:g} s; times must increase")
            if index:
                gap = via.time - self.path[index - 1].time
                check_duration(f"path[{index}].time", gap, whole=via.time)

    def poses(self) -> tuple[list[float], list[RigidTransform]]:
        """Returns the times [s], including the rest at the start, and the poses X_TM."""
        times = [self.rest + via.time for via in self.path]
        poses = [
            RigidTransform(
                RollPitchYaw(np.array(via.rpy)).ToRotationMatrix() @ FACING, via.position
            )
            for via in self.path
        ]
        return times, poses

    def mirrored(self) -> Self:
        """Returns the script for the other arm, mirrored at the robot's x-z plane."""
        mirror = super().mirrored()
        mirror.yaw = -self.yaw
        for via in mirror.path:
            via.mirror()
        return mirror


load_marker_script = partial(load_script, MarkerScript, shipped=MARKER_SCRIPTS)
"""Loads and checks a marker script that ships (by its name) or a YAML file; see `load_script`."""
