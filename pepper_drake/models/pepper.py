"""Pepper in a MultibodyPlant: joint groups, postures, coupled limits, and adding it to a plant."""

from bisect import bisect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.framework import Context

from pepper_drake.errors import InputError

MODELS_DIR = Path(__file__).parent
"""The folder of the package `pepper_drake_models`."""

PEPPER_URDF = MODELS_DIR / "pepper" / "pepper.urdf"

ARMS = ("left", "right")

JOINT_GROUPS: dict[str, tuple[str, ...]] = {
    "base": ("BaseX", "BaseY", "BaseYaw"),
    "body": ("HipRoll", "HipPitch", "KneePitch"),
    "head": ("HeadYaw", "HeadPitch"),
    "left_arm": ("LShoulderPitch", "LShoulderRoll", "LElbowYaw", "LElbowRoll", "LWristYaw"),
    "right_arm": ("RShoulderPitch", "RShoulderRoll", "RElbowYaw", "RElbowRoll", "RWristYaw"),
}
"""The actuated joints, each in exactly one group."""

BODY_JOINTS: tuple[str, ...] = tuple(
    name for group in ("head", "left_arm", "right_arm", "body") for name in JOINT_GROUPS[group]
)
"""The 15 position-controlled joints, in the order of every `joint_*` port."""

POSTURES: dict[str, dict[str, float]] = {
    "stand": {
        "HeadPitch": -0.21,
        "HipPitch": -0.03,
        "LShoulderPitch": 1.58,
        "LShoulderRoll": 0.12,
        "LElbowYaw": -1.22,
        "LElbowRoll": -0.52,
        "LWristYaw": -0.03,
        "RShoulderPitch": 1.58,
        "RShoulderRoll": -0.12,
        "RElbowYaw": 1.23,
        "RElbowRoll": 0.52,
        "RWristYaw": 0.03,
    },
    "upright": {  # Stand with a straight body: the torso frame is exactly 0.82 m above the floor.
        "LShoulderPitch": 1.58,
        "LShoulderRoll": 0.12,
        "LElbowYaw": -1.22,
        "LElbowRoll": -0.52,
        "LWristYaw": -0.03,
        "RShoulderPitch": 1.58,
        "RShoulderRoll": -0.12,
        "RElbowYaw": 1.23,
        "RElbowRoll": 0.52,
        "RWristYaw": 0.03,
    },
    "crouch": {
        "HeadPitch": 0.44,
        "HipPitch": -1.03,
        "KneePitch": 0.51,
        "LShoulderPitch": 1.11,
        "LShoulderRoll": 0.04,
        "LElbowYaw": -0.49,
        "LElbowRoll": -0.009,
        "LWristYaw": -0.78,
        "RShoulderPitch": 1.11,
        "RShoulderRoll": -0.04,
        "RElbowYaw": 0.49,
        "RElbowRoll": 0.009,
        "RWristYaw": 0.78,
    },
}
"""Named postures [rad]; unnamed joints are zero."""

# Coupled limits from the vendor's documentation (NAOqi 2.8) in degrees, linearly interpolated.
_HEAD_YAW = np.radians([33.33, 61.6, 91.4, 119.5]).tolist()
_HEAD_PITCH_LOWER = np.radians([-40.5, -35.2, -35.1, -35.0]).tolist()
_HEAD_PITCH_UPPER = np.radians([25.5, 20.9, 13.5, 13.5]).tolist()
_LEFT_ELBOW_YAW = np.radians([-119.5, -60.0, 0.0, 99.5, 119.5]).tolist()
_LEFT_ELBOW_ROLL_LOWER = np.radians([-78.0, -78.0, -89.5, -89.5, -80.0]).tolist()
_ELBOW_ROLL_STRAIGHT = 0.00872665


def hand_frame(arm: str) -> str:
    """Returns the name of an arm's hand control frame H, NAOqi's effector ("right" or "left")."""
    check_arm(arm)
    return f"{arm[0]}_hand_effector"


def arm_group(arm: str) -> str:
    """Returns the name of an arm's joint group ("right" or "left")."""
    check_arm(arm)
    return f"{arm}_arm"


def check_arm(arm: str) -> None:
    """Raises InputError unless `arm` is "left" or "right"."""
    if arm not in ARMS:
        raise InputError(f'arm is "{arm}"; it must be "left" or "right"')


def head_pitch_limits(head_yaw: float) -> tuple[float, float]:
    """Returns HeadPitch's (lower, upper) limits [rad] at a HeadYaw [rad]."""
    yaw = abs(head_yaw)
    return (
        _interpolated(yaw, _HEAD_YAW, _HEAD_PITCH_LOWER),
        _interpolated(yaw, _HEAD_YAW, _HEAD_PITCH_UPPER),
    )


def elbow_roll_limits(elbow_yaw: float, arm: str) -> tuple[float, float]:
    """Returns an ElbowRoll's (lower, upper) limits [rad] at that arm's ElbowYaw [rad].

    For the right arm, both angles have the opposite sign.
    """
    check_arm(arm)
    if arm == "left":
        lower = _interpolated(elbow_yaw, _LEFT_ELBOW_YAW, _LEFT_ELBOW_ROLL_LOWER)
        return lower, -_ELBOW_ROLL_STRAIGHT
    lower = _interpolated(-elbow_yaw, _LEFT_ELBOW_YAW, _LEFT_ELBOW_ROLL_LOWER)
    return _ELBOW_ROLL_STRAIGHT, -lower


@dataclass(frozen=True)
class CoupledLimit:
    """Limits of one joint, the follower, that depend on another's position, the leader's.

    Attributes:
        leader: Index of the leading joint (a yaw) among the given joints.
        follower: Index of the limited joint.
        positions: Positions of the leader, ascending (K,) [rad]; between them the limits are
            linear, beyond them constant.
        lower: Lower limit of the follower at each (K,) [rad].
        upper: Upper limit of the follower at each (K,) [rad].
    """

    leader: int
    follower: int
    positions: npt.NDArray[np.float64]
    lower: npt.NDArray[np.float64]
    upper: npt.NDArray[np.float64]

    @cached_property
    def strictest(self) -> tuple[float, float]:
        """Returns the lower and upper limit valid for any leader position [rad]."""
        return float(self.lower.max()), float(self.upper.min())

    def limits_at(self, position: float) -> tuple[float, float]:
        """Returns the follower's lower and upper limit at a position of the leader [rad]."""
        return (
            float(np.interp(position, self.positions, self.lower)),
            float(np.interp(position, self.positions, self.upper)),
        )


def coupled_limits(names: Sequence[str]) -> tuple[CoupledLimit, ...]:
    """Returns the coupled limits whose two joints are both among `names`, as tables.

    These are the limits of `head_pitch_limits` and `elbow_roll_limits`.
    """
    yaw = np.array(_HEAD_YAW)
    elbow_yaw = np.array(_LEFT_ELBOW_YAW)
    roll = np.array(_LEFT_ELBOW_ROLL_LOWER)
    straight = np.full(len(roll), -_ELBOW_ROLL_STRAIGHT)
    head_lower, head_upper = np.array(_HEAD_PITCH_LOWER), np.array(_HEAD_PITCH_UPPER)

    def mirrored(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return np.concatenate((values[::-1], values))

    tables = {
        ("HeadYaw", "HeadPitch"): (
            np.concatenate((-yaw[::-1], yaw)),
            mirrored(head_lower),
            mirrored(head_upper),
        ),
        ("LElbowYaw", "LElbowRoll"): (elbow_yaw, roll, straight),
        ("RElbowYaw", "RElbowRoll"): (-elbow_yaw[::-1], -straight, -roll[::-1]),
    }
    return tuple(
        CoupledLimit(names.index(leader), names.index(follower), *table)
        for (leader, follower), table in tables.items()
        if leader in names and follower in names
    )


def _interpolated(x: float, xs: Sequence[float], ys: Sequence[float]) -> float:
    """Interpolates linearly, constant beyond the table; for scalars faster than NumPy."""
    k = bisect(xs, x)
    if k in (0, len(xs)):
        return ys[min(k, len(xs) - 1)]
    share = (x - xs[k - 1]) / (xs[k] - xs[k - 1])
    return ys[k - 1] + share * (ys[k] - ys[k - 1])


def clamp_coupled_limits(positions: Mapping[str, float]) -> dict[str, float]:
    """Clamps HeadPitch and both ElbowRolls to the limits coupled to HeadYaw and the ElbowYaws.

    Args:
        positions: Joint positions [rad] by name, any subset of the joints. A limit whose leading
            joint (the yaw) is missing is not applied.

    Returns:
        A copy with the coupled joints clamped.
    """
    clamped = dict(positions)
    if "HeadPitch" in clamped and "HeadYaw" in clamped:
        lower, upper = head_pitch_limits(clamped["HeadYaw"])
        clamped["HeadPitch"] = min(max(clamped["HeadPitch"], lower), upper)
    for arm in ARMS:
        side = arm[0].upper()
        yaw, roll = f"{side}ElbowYaw", f"{side}ElbowRoll"
        if yaw in clamped and roll in clamped:
            lower, upper = elbow_roll_limits(clamped[yaw], arm)
            clamped[roll] = min(max(clamped[roll], lower), upper)
    return clamped


def mirror_joint_positions(positions: Mapping[str, float]) -> dict[str, float]:
    """Returns the mirror image (left for right) of joint positions given by name [rad].

    Pitches keep their sign; yaws, rolls and BaseY change sign; L and R are exchanged.
    """
    mirrored = {}
    for name, value in positions.items():
        keeps_sign = name.endswith("Pitch") or name == "BaseX"
        other = {"L": "R", "R": "L"}.get(name[0], name[0]) + name[1:]
        mirrored[other] = value if keeps_sign else -value
    return mirrored


def joint_names() -> tuple[str, ...]:
    """Returns the names of all actuated joints, group by group."""
    return tuple(name for group in JOINT_GROUPS.values() for name in group)


def posture_positions(posture: str, joints: Mapping[str, float] | None = None) -> dict[str, float]:
    """Returns all joint positions [rad, m] of a posture by name, with changes.

    Args:
        posture: A name in POSTURES.
        joints: Positions that replace the posture's.

    Raises:
        InputError: If the posture or one of the joints is unknown.
    """
    if posture not in POSTURES:
        raise InputError(f'posture is "{posture}"; it must be one of {", ".join(POSTURES)}')
    positions = dict.fromkeys(joint_names(), 0.0) | POSTURES[posture]
    for name, value in (joints or {}).items():
        if name not in positions:
            raise InputError(f'joints names "{name}", which Pepper does not have')
        positions[name] = float(value)
    return positions


def set_joint_positions(
    plant: MultibodyPlant,
    context: Context,
    model: ModelInstanceIndex,
    positions: Mapping[str, float],
) -> None:
    """Sets Pepper's joints by name [rad, m]; other joints keep their positions."""
    q = plant.GetPositions(context)
    for name, value in positions.items():
        q[plant.GetJointByName(name, model).position_start()] = value
    plant.SetPositions(context, q)


def add_pepper(plant: MultibodyPlant, *, posture: str = "stand") -> ModelInstanceIndex:
    """Adds Pepper to a plant that is not finalized yet, standing at the world's origin.

    Its floor link is welded to the world; the joints BaseX, BaseY and BaseYaw move it. Gains are
    not set. The default context has the posture.

    Args:
        plant: The plant; registered with a scene graph if shapes are needed.
        posture: A name in POSTURES.

    Returns:
        The model instance, named "pepper".
    """
    positions = posture_positions(posture)
    parser = Parser(plant)
    parser.package_map().AddPackageXml(MODELS_DIR / "package.xml")
    (model,) = parser.AddModels(PEPPER_URDF)
    plant.WeldFrames(plant.world_frame(), plant.GetFrameByName("odom", model))
    for name, value in positions.items():
        plant.GetJointByName(name, model).set_default_positions([value])
    return model
