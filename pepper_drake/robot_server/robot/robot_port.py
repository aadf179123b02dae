"""The robot as the services see it: its state, its commands, its images, its clock.

`RobotPort` is all that ALMotion, ALMemory and ALVideoDevice know of a robot. `KinematicRobot` is
one without dynamics, in virtual time; the simulator process stands behind another.

Joints are always the 17 of `pepper_drake.naoqi.constants.JOINTS`, in that order; hands run from
0 (closed) to 1 (open). Times are the robot's clock [s since the epoch].
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
import numpy.typing as npt

from pepper_drake.naoqi.constants import HANDS, JOINTS
from pepper_drake.robot_server.robot.robot_model import JOINT_LIMITS

Vector = npt.NDArray[np.float64]
Image = npt.NDArray[np.uint8] | npt.NDArray[np.float32]

SENSORS: tuple[str, ...] = (
    "Head/Touch/Front",
    "Head/Touch/Middle",
    "Head/Touch/Rear",
    "LHand/Touch/Back",
    "RHand/Touch/Back",
    "ChestBoard/Button",
    "Platform/FrontLeft/Bumper",
    "Platform/FrontRight/Bumper",
    "Platform/Back/Bumper",
)
"""Sensors that are touched or not, by NAOqi's device name."""


@dataclass(frozen=True)
class RobotState:
    """The robot's measurements at one time.

    Attributes:
        time: When, by the robot's clock [s].
        positions: Measured joint positions (17,) [rad; hands 0..1].
        velocities: Measured joint velocities (17,) [rad/s].
        base_pose: Base in the world by odometry: x, y [m], theta [rad].
        base_velocity: Base's velocity in its own frame: vx, vy [m/s], wz [rad/s].
        currents: Motor currents (17,) [A], or None where they are not simulated.
        torques: Of the motors at the joints (17,) [N m], likewise; those of hands are 0.
        touched: Those of `SENSORS` that are touched.
        ranges: Distances by device name, such as "Platform/Front/Sonar" [m]; only those that were
            measured.
    """

    time: float
    positions: Vector
    velocities: Vector
    base_pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    base_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    currents: Vector | None = None
    touched: frozenset[str] = frozenset()
    ranges: Mapping[str, float] = field(default_factory=dict)
    torques: Vector | None = None


@dataclass(frozen=True)
class RobotCommand:
    """ALMotion's command to the motors, made anew each cycle.

    Attributes:
        positions: Commanded joint positions (17,) [rad; hands 0..1].
        stiffnesses: From 0, limp, to 1 (17,).
        base_velocity: In the base's frame: vx, vy [m/s], wz [rad/s].
    """

    positions: Vector
    stiffnesses: Vector
    base_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class CameraImage:
    """An image as its camera took it.

    Attributes:
        time: When it was taken, by the robot's clock [s].
        pixels: (height, width, 3) RGB of uint8, or (height, width) of float32: depth along the
            optical axis [m], 0 or infinite where it is unknown.
    """

    time: float
    pixels: Image


class RobotPort(Protocol):
    """A robot."""

    def state(self) -> RobotState:
        """Returns the newest state."""

    def command(self, command: RobotCommand) -> None:
        """Passes a command to the motors."""

    def want_image(self, camera: int, width: int, height: int, fps: float) -> None:
        """Asks a camera for images of at least a size at a rate; 0 pixels at 0 fps: no more."""

    def image(self, camera: int) -> CameraImage | None:
        """Returns a camera's newest image, of whatever size it has, or None.

        None before the first that was taken since the camera was asked: no image is from before.
        """


@dataclass
class KinematicRobot:
    """A robot whose stiff joints stand where they are told, for tests and without a clock.

    Time passes only by `advance`. A limp joint stays where it is, or where `lead` puts it. A
    stiff one follows by its stiffness: `follow` is the share of the way at stiffness 1.

    Attributes:
        now: The robot's clock [s].
        follow: Share of the way to the command that a joint goes in a cycle, from 0 to 1.
        images: Image by camera id.
        wanted: What `want_image` asked for, by camera id.
        commands: Every command that came, oldest first.
    """

    now: float = 1_500_000_000.0
    follow: float = 1.0
    images: dict[int, CameraImage] = field(default_factory=dict)
    wanted: dict[int, tuple[int, int, float]] = field(default_factory=dict)
    commands: list[RobotCommand] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._positions = np.array([_inside(name) for name in JOINTS])
        self._velocities = np.zeros(len(JOINTS))
        self._pose = (0.0, 0.0, 0.0)
        self._touched: frozenset[str] = frozenset()
        self._ranges: dict[str, float] = {}

    def state(self) -> RobotState:
        """Returns the state now."""
        velocity = self.commands[-1].base_velocity if self.commands else (0.0, 0.0, 0.0)
        return RobotState(
            self.now,
            self._positions.copy(),
            self._velocities.copy(),
            self._pose,
            velocity,
            np.zeros(len(JOINTS)),
            self._touched,
            dict(self._ranges),
        )

    def command(self, command: RobotCommand) -> None:
        """Keeps a command, which `advance` obeys."""
        self.commands.append(command)

    def want_image(self, camera: int, width: int, height: int, fps: float) -> None:
        """Keeps what is asked for."""
        if fps > 0:
            self.wanted[camera] = (width, height, fps)
        else:
            self.wanted.pop(camera, None)

    def image(self, camera: int) -> CameraImage | None:
        """Returns the image put into `images`."""
        return self.images.get(camera)

    def advance(self, duration: float) -> None:
        """Lets time pass under the newest command [s]."""
        self.now += duration
        if not self.commands:
            return
        command = self.commands[-1]
        share = self.follow * np.clip(command.stiffnesses, 0.0, 1.0)
        step = np.where(command.stiffnesses > 0.0, share, 0.0) * (
            command.positions - self._positions
        )
        self._positions = self._positions + step
        self._velocities = step / duration
        vx, vy, wz = command.base_velocity
        x, y, theta = self._pose
        middle = theta + wz * duration / 2
        self._pose = (
            x + (vx * math.cos(middle) - vy * math.sin(middle)) * duration,
            y + (vx * math.sin(middle) + vy * math.cos(middle)) * duration,
            theta + wz * duration,
        )

    def lead(self, positions: Mapping[str, float]) -> None:
        """Puts joints somewhere by hand [rad]."""
        for name, value in positions.items():
            self._positions[JOINTS.index(name)] = value

    def touch(self, *sensors: str) -> None:
        """Touches these sensors and no others."""
        self._touched = frozenset(sensors)

    def measure(self, ranges: Mapping[str, float]) -> None:
        """Lets devices measure these distances [m] and no others."""
        self._ranges = dict(ranges)


def _inside(name: str) -> float:
    """Returns the position within a joint's limits that is nearest zero."""
    limits = JOINT_LIMITS[name]
    return 0.5 if name in HANDS else min(max(0.0, limits.lower), limits.upper)
