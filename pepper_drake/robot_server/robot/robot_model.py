"""Pepper's limits and frames by NAOqi's names."""

import math
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex

from pepper_drake.models.pepper import (
    PEPPER_URDF,
    add_pepper,
    elbow_roll_limits,
    head_pitch_limits,
)
from pepper_drake.naoqi.constants import (
    CHAINS,
    FRAME_ROBOT,
    FRAME_TORSO,
    FRAME_WORLD,
    HANDS,
    JOINTS,
    WHEELS,
)

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class JointLimits:
    """Limits of one joint.

    Attributes:
        lower: Least position [rad; hands 0..1].
        upper: Largest position.
        velocity: Largest speed [rad/s].
        effort: Largest torque [N m].
    """

    lower: float
    upper: float
    velocity: float
    effort: float


def _read_limits() -> dict[str, JointLimits]:
    limits = {}
    for joint in ElementTree.parse(PEPPER_URDF).getroot().iter("joint"):
        limit = joint.find("limit")
        if limit is None or joint.get("name") not in JOINTS:
            continue
        lower, upper, velocity, effort = (
            float(limit.get(key, "nan")) for key in ("lower", "upper", "velocity", "effort")
        )
        limits[str(joint.get("name"))] = JointLimits(lower, upper, velocity, effort)
    # Hands and wheels are fixed in the model; these are the robot's motor limits.
    limits |= dict.fromkeys(HANDS, JointLimits(0.0, 1.0, 12.56, 0.144))
    limits |= dict.fromkeys(WHEELS, JointLimits(0.0, 0.0, 6.28319, 3.25))
    return limits


JOINT_LIMITS: dict[str, JointLimits] = _read_limits()
"""Limits by the name of a joint or wheel."""

LOWER: Vector = np.array([JOINT_LIMITS[name].lower for name in JOINTS])
UPPER: Vector = np.array([JOINT_LIMITS[name].upper for name in JOINTS])
MAX_VELOCITY: Vector = np.array([JOINT_LIMITS[name].velocity for name in JOINTS])

_HEAD = (JOINTS.index("HeadYaw"), JOINTS.index("HeadPitch"))
_ELBOWS = {
    "left": (JOINTS.index("LElbowYaw"), JOINTS.index("LElbowRoll")),
    "right": (JOINTS.index("RElbowYaw"), JOINTS.index("RElbowRoll")),
}


def clip_to_limits(positions: Vector) -> Vector:
    """Returns joint positions (17,) clipped to all limits, including the yaw-coupled ones."""
    clipped = np.clip(positions, LOWER, UPPER)
    yaw, pitch = _HEAD
    lower, upper = head_pitch_limits(float(clipped[yaw]))
    clipped[pitch] = min(max(clipped[pitch], lower), upper)
    for arm, (yaw, roll) in _ELBOWS.items():
        lower, upper = elbow_roll_limits(float(clipped[yaw]), arm)
        clipped[roll] = min(max(clipped[roll], lower), upper)
    return clipped


_OF_EFFECTORS = {
    "Torso": "torso",
    "Head": "Head",
    "LArm": "l_hand_effector",
    "RArm": "r_hand_effector",
    "HeadYaw": "Neck",
    "HeadPitch": "Head",
    "LShoulderPitch": "LShoulder",
    "LShoulderRoll": "LBicep",
    "LElbowYaw": "LElbow",
    "LElbowRoll": "LForeArm",
    "LWristYaw": "l_wrist",
    "LHand": "l_hand_effector",
    "RShoulderPitch": "RShoulder",
    "RShoulderRoll": "RBicep",
    "RElbowYaw": "RElbow",
    "RElbowRoll": "RForeArm",
    "RWristYaw": "r_wrist",
    "RHand": "r_hand_effector",
    "HipRoll": "Hip",
    "HipPitch": "Pelvis",
    "KneePitch": "Tibia",
}

# Sensors: link of the model, position [m], roll, pitch, yaw [rad]. x is along a camera's view.
_SENSORS: dict[str, tuple[str, tuple[float, float, float], tuple[float, float, float]]] = {
    "CameraTop": ("Head", (0.08601, 0, 0.16284), (0, 0, 0)),
    "CameraBottom": ("Head", (0.09262, 0, 0.06177), (0, 0.698132, 0)),
    "CameraDepth": ("Head", (0.05138, 0.039, 0.1194), (0, 0, 0)),
    "Head/Touch/Front": ("Head", (0.028175, 0, 0.21267), (0, 0.20944, 0)),
    "Head/Touch/Middle": ("Head", (0.0041, 0, 0.2159), (0, -0.0349066, 0)),
    "Head/Touch/Rear": ("Head", (-0.03376, 0, 0.21052), (0, -0.314159, 0)),
    "LHand/Touch/Back": ("l_wrist", (0.0523, 0, 0.0304), (1.5708, -1.5708, -math.pi)),
    "RHand/Touch/Back": ("r_wrist", (0.0523, 0, 0.0304), (1.5708, -1.5708, -math.pi)),
    "ChestBoard/Button": ("torso", (0.049871, 0.001588, 0.055163), (0, 0, 0)),
    "Tablet": ("torso", (0.0839249, 0, 0.06251), (0, -0.523599, 0)),
    "Accelerometer": ("torso", (0.00239, -0.03575, 0.00626), (0, 0, 0)),
    "Gyrometer": ("torso", (0.00204, -0.03491, -0.00959), (0, 0, 0)),
    "AccelerometerBase": ("Tibia", (0.0147, -0.0017, -0.26319), (0, 0, 0)),
    "Bumper/FrontLeft": ("Tibia", (0.129, 0.227, -0.264), (0, 0, 0.48886)),
    "Bumper/FrontRight": ("Tibia", (0.129, -0.227, -0.264), (0, 0, -0.48886)),
    "Bumper/Back": ("Tibia", (-0.251, 0, -0.264), (0, 0, math.pi)),
    "LaserSensor/Front": ("Tibia", (0.0562, 0, -0.0692), (0, 0.349066, 0)),
    "LaserSensor/Left": ("Tibia", (-0.018, 0.0899, -0.0759), (0, 0.349066, math.pi / 2)),
    "LaserSensor/Right": ("Tibia", (-0.018, -0.0899, -0.0759), (0, 0.349066, -math.pi / 2)),
    "Sonar/Front": ("Tibia", (0.0699, 0, -0.1023), (0, -0.322858, 0)),
    "Sonar/Back": ("Tibia", (-0.0718, 0, -0.0534), (0, -0.209438, math.pi)),
}

SENSOR_NAMES: tuple[str, ...] = tuple(_SENSORS)
"""Sensors whose position `getPosition` returns."""

# The leg's effector: below the knee, between the wheels, at the floor.
_LEG = ("Tibia", (-0.0062, 0.0, -0.334))


class UnknownFrameError(KeyError):
    """A name that is not a joint, effector or sensor."""


class Kinematics:
    """Poses of Pepper's frames by NAOqi's names.

    Frame "robot" is the base's, on the floor, and "world" is the base's at the start of odometry.
    """

    def __init__(self) -> None:
        self._plant = MultibodyPlant(time_step=0.0)
        self._model = model = add_pepper(self._plant)
        self._plant.Finalize()
        self._context = self._plant.CreateDefaultContext()
        self._starts = {
            name: self._plant.GetJointByName(name, model).position_start()
            for name in (*(j for j in JOINTS if j not in HANDS), "BaseX", "BaseY", "BaseYaw")
        }

    def transform(
        self, name: str, frame: int, positions: Vector, base_pose: tuple[float, float, float]
    ) -> RigidTransform:
        """Computes the pose of a joint, effector or sensor.

        Args:
            name: Its NAOqi name.
            frame: FRAME_TORSO, FRAME_WORLD or FRAME_ROBOT.
            positions: Joint positions (17,) [rad].
            base_pose: Base in the world: x, y [m], theta [rad].

        Returns:
            The frame's pose in `frame`.

        Raises:
            UnknownFrameError: There is no such frame.
            ValueError: `frame` is not one of the three.
        """
        link, X_LF = self._find(name)
        q = self._plant.GetPositions(self._context)
        for joint, value in zip(JOINTS, positions, strict=True):
            if joint in self._starts:
                q[self._starts[joint]] = value
        for joint, value in zip(("BaseX", "BaseY", "BaseYaw"), base_pose, strict=True):
            q[self._starts[joint]] = value
        self._plant.SetPositions(self._context, q)
        if frame == FRAME_WORLD:
            reference = self._plant.world_frame()
        elif frame in (FRAME_TORSO, FRAME_ROBOT):
            reference = self._plant.GetFrameByName(
                "torso" if frame == FRAME_TORSO else "base_footprint"
            )
        else:
            raise ValueError(f"frame is {frame}; it must be 0 (torso), 1 (world) or 2 (robot)")
        return self._plant.GetFrameByName(link).CalcPose(self._context, reference) @ X_LF

    def mass(self, name: str) -> float:
        """Returns the mass of "Body", of a chain, or of the link that a joint moves [kg]."""
        return sum(self._plant.get_body(body).default_mass() for body in self._bodies(name))

    def center_of_mass(
        self, name: str, frame: int, positions: Vector, base_pose: tuple[float, float, float]
    ) -> Vector:
        """Returns the centre of mass (3,) in a frame [m]; arguments as of `mass`, `transform`."""
        X_WF = self.transform("Torso", FRAME_WORLD, positions, base_pose) @ (
            self.transform("Torso", frame, positions, base_pose).inverse()
        )
        bodies = [self._plant.get_body(body) for body in self._bodies(name)]
        masses = np.array([body.default_mass() for body in bodies])
        if masses.sum() <= 0.0:
            raise ValueError(f"{name} has no mass of its own in the model")
        centers = np.array(
            [
                self._plant.EvalBodyPoseInWorld(self._context, body) @ body.default_com()
                for body in bodies
            ]
        )
        return X_WF.inverse() @ (masses @ centers / masses.sum())

    def _bodies(self, name: str) -> list[BodyIndex]:
        if name == "Body":
            return [
                index
                for index in self._plant.GetBodyIndices(self._model)
                if index != self._plant.world_body().index()
            ]
        joints = [joint for joint in CHAINS.get(name, (name,)) if joint not in HANDS]
        if not all(self._plant.HasJointNamed(joint, self._model) for joint in joints):
            raise UnknownFrameError(name)
        return [
            self._plant.GetJointByName(joint, self._model).child_body().index() for joint in joints
        ]

    def _find(self, name: str) -> tuple[str, RigidTransform]:
        if name in _OF_EFFECTORS:
            return _OF_EFFECTORS[name], RigidTransform()
        if name == "Leg":
            return _LEG[0], RigidTransform(_LEG[1])
        if name in _SENSORS:
            link, position, rpy = _SENSORS[name]
            return link, RigidTransform(RollPitchYaw(*rpy), position)
        raise UnknownFrameError(name)


@lru_cache(maxsize=1)
def kinematics() -> Kinematics:
    """Returns the kinematic model, one per process."""
    return Kinematics()


def as_position6(X: RigidTransform) -> list[float]:
    """Returns a pose as NAOqi's x, y, z, wx, wy, wz with R = Rz(wz) Ry(wy) Rx(wx) [m, rad]."""
    return [*X.translation().tolist(), *RollPitchYaw(X.rotation()).vector().tolist()]


def as_transform16(X: RigidTransform) -> list[float]:
    """Returns a pose as the 16 numbers of its matrix, row by row."""
    return X.GetAsMatrix4().ravel().tolist()
