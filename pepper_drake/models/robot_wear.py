"""Errors of a worn robot: backlash, encoder offsets, camera misalignment, slip and latency."""

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from pepper_drake.models.pepper import BODY_JOINTS

Vector = npt.NDArray[np.float64]

ROBOTS = ("ideal", "worn")
"""Simulated robots: as in the model, and worn."""

HEAD_CAMERAS = ("camera_top", "camera_bottom", "camera_depth")

_HEAD_TURN = 0.6
"""Angle between views that the head takes of one place [rad]: most of an image's height."""


@dataclass(frozen=True)
class WearSizes:
    """Largest errors; each is drawn uniformly within ± this value, except backlash and latency."""

    backlash: float = np.radians(1.0)
    """Backlash of each joint from end to end [rad], from service reports of real Peppers."""
    encoder_offset: float = np.radians(0.5)
    """Offset of each joint's encoder [rad]."""
    camera_angle: float = np.radians(1.0)
    """Angular misalignment of each camera [rad], about a random axis."""
    camera_position: float = 0.005
    """Displacement of each camera [m], in a random direction."""
    focal: float = 0.01
    """Relative error of each focal length."""
    odometry: float = 0.03
    """Relative error of the base's measured displacement and rotation, due to wheel slip."""
    command_latency: float = 0.04
    """Time from a joint command to the motor [s]; not drawn."""

    @property
    def pointing_error(self) -> float:
        """Largest error of a head camera's orientation relative to another view [rad].

        The neck's slack, and the change of a misalignment as the head turns by `_HEAD_TURN`.
        """
        return self.backlash + 2.0 * np.sin(0.5 * _HEAD_TURN) * self.camera_angle


@dataclass(frozen=True)
class CameraWear:
    """Errors of a camera's extrinsics and focal length, relative to the model.

    Attributes:
        position: Offset of the optical centre in the Head frame (3,) [m].
        rotation: Small rotation of the optical frame, roll, pitch, yaw in it (3,) [rad].
        focal: True focal length divided by the model's.
    """

    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)
    focal: float = 1.0


@dataclass(frozen=True, eq=False)
class RobotWear:
    """The errors of one robot.

    Attributes:
        backlash: Backlash of each joint from end to end (15,) [rad], in the order of BODY_JOINTS.
        encoder_offset: Encoder reading minus true angle (15,) [rad].
        cameras: Errors of the cameras by the station's names.
        odometry: Relative error of the odometry in x, y, yaw (3,).
        command_latency: Time from a joint command to the motor [s].
    """

    backlash: Vector = field(default_factory=lambda: np.zeros(len(BODY_JOINTS)))
    encoder_offset: Vector = field(default_factory=lambda: np.zeros(len(BODY_JOINTS)))
    cameras: dict[str, CameraWear] = field(default_factory=dict)
    odometry: Vector = field(default_factory=lambda: np.zeros(3))
    command_latency: float = 0.0

    @classmethod
    def draw(cls, seed: int, sizes: WearSizes | None = None) -> "RobotWear":
        """Draws the errors of a robot; the same seed gives the same robot."""
        sizes = WearSizes() if sizes is None else sizes
        rng = np.random.default_rng((seed, 0x3A))
        n = len(BODY_JOINTS)

        def direction() -> Vector:
            vector = rng.normal(size=3)
            return np.asarray(vector / np.linalg.norm(vector))

        def around(size: float, number: int) -> Vector:
            return rng.uniform(-size, size, number)

        cameras = {}
        for name in HEAD_CAMERAS:
            position = sizes.camera_position * rng.random() * direction()
            rotation = sizes.camera_angle * rng.random() * direction()
            cameras[name] = CameraWear(
                (float(position[0]), float(position[1]), float(position[2])),
                (float(rotation[0]), float(rotation[1]), float(rotation[2])),
                1.0 + float(around(sizes.focal, 1)[0]),
            )
        return cls(
            backlash=np.full(n, sizes.backlash),
            encoder_offset=around(sizes.encoder_offset, n),
            cameras=cameras,
            odometry=around(sizes.odometry, 3),
            command_latency=sizes.command_latency,
        )

    def calibrated(self, encoder_offset: Vector) -> "RobotWear":
        """Returns the errors that remain after correcting estimated encoder offsets (15,) [rad]."""
        return replace(self, encoder_offset=self.encoder_offset - encoder_offset)
