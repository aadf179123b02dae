"""Calibration of one robot: what its encoders and cameras say too much, in a file for all apps."""

import math
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from pepper_drake.errors import InputError
from pepper_drake.models.pepper import BODY_JOINTS, check_arm
from pepper_drake.models.robot_wear import HEAD_CAMERAS
from pepper_drake.models.typed_yaml import line_of_field, load_yaml, save_yaml

UNITS = {"angles": "rad", "lengths": "m", "image": "pixel"}
"""The units of every calibration file."""

LARGEST_ANGLE = math.radians(10.0)
"""No offset, slack or mounting angle is larger [rad]: it would be a mistake, or a broken robot."""
LARGEST_LENGTH = 0.05
"""No camera is mounted farther from its place [m]."""
LARGEST_FOCAL = 0.1
"""No focal length is farther from the model's, as a share of it."""


@dataclass
class JointCalibration:
    """A joint's encoder and gear."""

    offset: float = 0.0  # What the encoder says too much [rad].
    offset_sigma: float = 0.0  # Its standard deviation [rad].
    slack: float = 0.0  # Of the gear, from end to end [rad].
    slack_sigma: float = 0.0  # [rad]


@dataclass
class CameraCalibration:
    """A camera's place on the head, and its lens, against the model's."""

    position: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # In Head [m].
    position_sigma: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # [m]
    # Of the optical frame, roll, pitch, yaw in it [rad].
    rotation: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    rotation_sigma: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # [rad]
    focal: float = 1.0  # True focal length over the model's.
    focal_sigma: float = 0.0


@dataclass
class CalibrationResiduals:
    """Distances between the marker as seen and as the joints have it, root mean squares."""

    position_before: float = 0.0  # By the model as it is [m].
    position_after: float = 0.0  # By the calibration [m].
    rotation_before: float = 0.0  # [rad]
    rotation_after: float = 0.0  # [rad]
    image_after: float = 0.0  # Of the marker's corners in the images [pixel].
    postures: int = 0  # In which the marker was seen.
    images: int = 0  # In which it was seen.


@dataclass
class RobotCalibration:
    """All that a calibration found out about one robot."""

    robot: str = ""  # Which robot: "worn, seed 3", or a real one's address.
    date: str = ""  # When, as 2026-11-28T23:15:00+00:00.
    reason: str = ""  # Why it was made.
    arm: str = "right"  # The arm that held the marker.
    units: dict[str, str] = field(default_factory=lambda: dict(UNITS))
    joints: dict[str, JointCalibration] = field(default_factory=dict)  # By name.
    cameras: dict[str, CameraCalibration] = field(default_factory=dict)  # By the station's name.
    residuals: CalibrationResiduals = field(default_factory=CalibrationResiduals)
    # What the images cannot tell apart, held by what wear is usual.
    held: list[str] = field(default_factory=list)

    def check(self) -> None:
        """Checks what the types do not say.

        Raises:
            InputError: A field makes no sense; the sentence begins with its name.
        """
        if not self.robot:
            raise InputError("robot is empty; name the robot that was calibrated")
        try:
            datetime.fromisoformat(self.date)
        except ValueError:
            raise InputError(
                f'date is "{self.date}"; give it as 2026-11-28T23:15:00+00:00'
            ) from None
        check_arm(self.arm)
        if self.units != UNITS:
            words = ", ".join(f"{key}: {unit}" for key, unit in UNITS.items())
            raise InputError(f"units must be {words}; convert the numbers")
        if not self.joints and not self.cameras:
            raise InputError("joints and cameras are both empty; calibrate the robot again")
        for name, joint in self.joints.items():
            if name not in BODY_JOINTS:
                raise InputError(f'joints names "{name}", which Pepper does not have')
            _check_size([joint.offset], LARGEST_ANGLE, f"joints.{name}.offset", "rad")
            _check_size([joint.slack], LARGEST_ANGLE, f"joints.{name}.slack", "rad")
            if joint.slack < 0.0:
                raise InputError(f"joints.{name}.slack is {joint.slack:g}; it cannot be negative")
        for name, camera in self.cameras.items():
            self._check_camera(name, camera)

    @staticmethod
    def _check_camera(name: str, camera: CameraCalibration) -> None:
        if name not in HEAD_CAMERAS:
            raise InputError(
                f'cameras names "{name}"; a camera is one of {", ".join(HEAD_CAMERAS)}'
            )
        for key, largest, unit in (
            ("position", LARGEST_LENGTH, "m"),
            ("rotation", LARGEST_ANGLE, "rad"),
        ):
            for part in (key, f"{key}_sigma"):
                value = getattr(camera, part)
                if len(value) != 3:
                    raise InputError(f"cameras.{name}.{part} has {len(value)} numbers; give three")
                _check_size(value, largest, f"cameras.{name}.{part}", unit)
        _check_size([camera.focal - 1.0], LARGEST_FOCAL, f"cameras.{name}.focal", "", about=1.0)

    def check_robot(self, robot: str) -> None:
        """Raises InputError if it was made of another robot than this one."""
        if robot != self.robot:
            raise InputError(
                f'the calibration is of the robot "{self.robot}" and this is "{robot}"; calibrate '
                "this one (calibrate.py), or leave --calibration out"
            )

    def joint_values(self, name: str) -> list[float]:
        """Returns a value ("offset" or "slack") of each of BODY_JOINTS (15,) [rad]."""
        none = JointCalibration()
        return [float(getattr(self.joints.get(joint, none), name)) for joint in BODY_JOINTS]


def _check_size(
    values: list[float], largest: float, name: str, unit: str, about: float = 0.0
) -> None:
    for value in values:
        if abs(value) > largest:
            bounds = f"{about:g} ± {largest:.3g} {unit}".rstrip()
            raise InputError(
                f"{name} has {value + about:g}; it must be within {bounds}: check robot and unit"
            )


def simulated_robot(robot: str, seed: int) -> str:
    """Returns the name in calibration files of a simulated robot: "ideal" or "worn, seed 3"."""
    return robot if robot == "ideal" else f"{robot}, seed {seed}"


def load_calibration(path: Path) -> RobotCalibration:
    """Loads a calibration.

    Raises:
        InputError: The file is no calibration, or a number in it cannot be; the sentence names
            file, line and field.
    """
    calibration = load_yaml(RobotCalibration, path)
    try:
        calibration.check()
    except InputError as error:
        line = line_of_field(path, str(error).split()[0])
        raise InputError(f"{path} line {line}: {error}") from None
    return calibration


def calibration_of(name: str | None, robot: str, seed: int) -> RobotCalibration | None:
    """Loads the calibration of a simulated robot.

    Args:
        name: The file; `{seed}` in it stands for the seed. None or empty for no calibration.
        robot: "ideal" or "worn".
        seed: The robot's.

    Raises:
        InputError: As `load_calibration`, or it is another robot's.
    """
    if not name:
        return None
    path = Path(name.replace("{seed}", str(seed)))
    calibration = load_calibration(path)
    try:
        calibration.check_robot(simulated_robot(robot, seed))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return calibration


def save_calibration(calibration: RobotCalibration, path: Path) -> None:
    """Writes a calibration that `load_calibration` reads back."""
    calibration.check()
    save_yaml(calibration, path)
