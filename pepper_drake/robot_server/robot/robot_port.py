"""The robot for the services: its state, commands, images and clock.

`RobotPort` is the interface of ALMotion, ALMemory and ALVideoDevice to a robot. `KinematicRobot`
has no dynamics, and runs in virtual time; `SimulatedRobot` is the simulator's process.

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
"""Touch sensors by NAOqi's device name."""


@dataclass(frozen=True)
class RobotState:
    """The robot's measurements at one time.

    Attributes:
        time: Time by the robot's clock [s].
        positions: Measured joint positions (17,) [rad; hands 0..1].
        velocities: Measured joint velocities (17,) [rad/s].
        base_pose: Base in the world by odometry: x, y [m], theta [rad].
        base_velocity: Base's velocity in its own frame: vx, vy [m/s], wz [rad/s].
        currents: Motor currents (17,) [A], or None if not simulated.
        touched: Those of `SENSORS` that are touched.
        ranges: Measured distances by device name, such as "Platform/Front/Sonar" [m].
    """

    time: float
    positions: Vector
    velocities: Vector
    base_pose: tuple[float, float, float] = (0.0, 0.0, 0.0)
    base_velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    currents: Vector | None = None
    touched: frozenset[str] = frozenset()
    ranges: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class RobotCommand:
    """ALMotion's command to the motors in one cycle.

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
    """An image of a camera.

    Attributes:
        time: Capture time by the robot's clock [s].
        pixels: (height, width, 3) RGB of uint8, or (height, width) of float32: depth along the
            optical axis [m], 0 or infinite where unknown.
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
        """Requests images of a camera of at least a size at a rate; 0 fps ends them."""

    def image(self, camera: int) -> CameraImage | None:
        """Returns a camera's newest image, of any size, or None.

        None before the first image captured since the request.
        """


@dataclass
class KinematicRobot:
    """A robot whose stiff joints take their commands, for tests, without a clock.

    Time passes only by `advance`. A limp joint stays, or is moved by `lead`. A stiff one covers a
    share of the distance to its command each cycle: `follow` times its stiffness.

    Attributes:
        now: The robot's clock [s].
        follow: Share of the distance to the command covered in a cycle, from 0 to 1.
        images: Image by camera id.
        wanted: Requests of `want_image` by camera id.
        commands: All commands, oldest first.
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
        """Stores a command for `advance`."""
        self.commands.append(command)

    def want_image(self, camera: int, width: int, height: int, fps: float) -> None:
        """Stores the request."""
        if fps > 0:
            self.wanted[camera] = (width, height, fps)
        else:
            self.wanted.pop(camera, None)

    def image(self, camera: int) -> CameraImage | None:
        """Returns the image put into `images`."""
        return self.images.get(camera)

    def advance(self, duration: float) -> None:
        """Advances time by a duration [s] under the newest command."""
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
        """Moves joints by hand to positions [rad]."""
        for name, value in positions.items():
            self._positions[JOINTS.index(name)] = value

    def touch(self, *sensors: str) -> None:
        """Touches these sensors and no others."""
        self._touched = frozenset(sensors)

    def measure(self, ranges: Mapping[str, float]) -> None:
        """Sets the measured distances by device [m]."""
        self._ranges = dict(ranges)


def _inside(name: str) -> float:
    """Returns the position within a joint's limits nearest to zero."""
    limits = JOINT_LIMITS[name]
    return 0.5 if name in HANDS else min(max(0.0, limits.lower), limits.upper)
