"""Calibration of one robot: errors of its encoders and cameras, in a file for all apps."""

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
"""Largest plausible offset, backlash or angular misalignment [rad]; larger is a mistake."""
LARGEST_LENGTH = 0.05
"""Largest plausible displacement of a camera [m]."""
LARGEST_FOCAL = 0.1
"""Largest plausible relative error of a focal length."""


@dataclass
class JointCalibration:
    """Errors of a joint's encoder and gear."""

    offset: float = 0.0  # Encoder reading minus true angle [rad].
    offset_sigma: float = 0.0  # Its standard deviation [rad].
    slack: float = 0.0  # Backlash from end to end [rad].
    slack_sigma: float = 0.0  # [rad]


@dataclass
class CameraCalibration:
    """Errors of a camera's extrinsics and focal length, relative to the model."""

    position: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # In Head [m].
    position_sigma: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # [m]
    # Rotation of the optical frame, roll, pitch, yaw in it [rad].
    rotation: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])
    rotation_sigma: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])  # [rad]
    focal: float = 1.0  # True focal length divided by the model's.
    focal_sigma: float = 0.0


@dataclass
class CalibrationResiduals:
    """Root mean square errors between the observed marker and the one predicted from the joints."""

    position_before: float = 0.0  # Without calibration [m].
    position_after: float = 0.0  # With calibration [m].
    rotation_before: float = 0.0  # [rad]
    rotation_after: float = 0.0  # [rad]
    image_after: float = 0.0  # Error of the marker's corners in the images [pixel].
    postures: int = 0  # Number of postures in which the marker was seen.
    images: int = 0  # Number of images used.


@dataclass
class RobotCalibration:
    """Result of the calibration of one robot."""

    robot: str = ""  # The robot: "worn, seed 3", or a real one's address.
    date: str = ""  # Time, as 2026-11-28T23:15:00+00:00.
    reason: str = ""  # Reason for the calibration.
    arm: str = "right"  # The arm that held the marker.
    units: dict[str, str] = field(default_factory=lambda: dict(UNITS))
    joints: dict[str, JointCalibration] = field(default_factory=dict)  # By name.
    cameras: dict[str, CameraCalibration] = field(default_factory=dict)  # By the station's name.
    residuals: CalibrationResiduals = field(default_factory=CalibrationResiduals)
    # Combinations of parameters determined by the priors, not by the images.
    held: list[str] = field(default_factory=list)

    def check(self) -> None:
        """Checks the values of the fields.

        Raises:
            InputError: A field makes no sense; the message begins with its name.
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
        """Raises InputError if the calibration is of another robot."""
        if robot != self.robot:
            raise InputError(
                f'the calibration is of the robot "{self.robot}" and this is "{robot}"; calibrate '
                "this one (calibrate.py), or leave --calibration out"
            )

    def joint_values(self, name: str) -> list[float]:
        """Returns a value ("offset" or "slack") of all BODY_JOINTS (15,) [rad]."""
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
    """Returns a simulated robot's name in calibration files: "ideal" or "worn, seed 3"."""
    return robot if robot == "ideal" else f"{robot}, seed {seed}"


def load_calibration(path: Path) -> RobotCalibration:
    """Loads a calibration.

    Raises:
        InputError: The file is no calibration, or a value is impossible; the message names file,
            line and field.
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
        seed: The robot's seed.

    Raises:
        InputError: See `load_calibration`; or the calibration is of another robot.
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
