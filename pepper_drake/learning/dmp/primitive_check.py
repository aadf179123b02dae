"""Trial rollout of a primitive from a file, whose numbers may be inconsistent."""

from pathlib import Path

import numpy as np

from pepper_drake.errors import InputError
from pepper_drake.learning.dmp.joint_primitive import JointPrimitive
from pepper_drake.learning.dmp.primitive import MovementPrimitive
from pepper_drake.learning.dmp.transformation import TransformationModel

LONGEST, SHORTEST = 600.0, 0.01
"""Limits of a movement's duration [s]."""

FARTHEST = 10.0
"""Largest distance of the hand from the torso's frame [m]."""

_FASTEST_TURN = 1e3
"""Largest angular speed of a hand [rad/s]."""

_STEPS = 200
_MOST_NUMBERS = 4_000_000
"""Limit of samples at 100 Hz times basis functions: a rollout's use of memory."""


def check_movement(primitive: MovementPrimitive, path: Path) -> MovementPrimitive:
    """Rolls a primitive out once, coarsely, and returns it.

    Args:
        primitive: As read.
        path: Its file, for errors.

    Raises:
        InputError: It takes too long, has inconsistent parts, or leads too far.
    """
    duration = primitive.duration
    _check_duration(duration, primitive.translation, path)
    if not 0.0 <= primitive.path_length <= 1e4:
        raise InputError(f"{path}: path_length: {primitive.path_length:g} m makes no sense")
    parts = [("translation", primitive.translation)]
    if primitive.orientation is not None:
        parts.append(("orientation", primitive.orientation.attractor))
        for name in ("start", "goal"):
            quaternion = getattr(primitive.orientation, name)
            if abs(np.linalg.norm(quaternion) - 1.0) > 1e-3:
                raise InputError(f"{path}: orientation.{name}: must be a unit quaternion")
    for name, part in parts:
        _check_gain(part, name, path)
    try:
        with np.errstate(all="ignore"):
            path_T = primitive.rollout(time_step=duration / _STEPS)
            arrays = [path_T.positions, path_T.velocities, path_T.accelerations]
            if path_T.rotations is not None:
                arrays.append(path_T.rotations)
            if path_T.angular_velocities is not None:
                arrays.append(path_T.angular_velocities)
                if np.any(np.abs(path_T.angular_velocities) > _FASTEST_TURN):
                    raise ValueError(f"the hand turns faster than {_FASTEST_TURN:g} rad/s")
            if primitive.posture is not None:
                joints = primitive.posture.at(np.linspace(0.0, 1.0, 11))
                arrays.append(joints)
                if joints.shape != (11, len(primitive.posture.names)):
                    raise ValueError("as many weights as names are needed in posture")
                if not np.all(np.abs(joints) <= 2 * np.pi):
                    raise ValueError("posture leads beyond any joint")
    except (ValueError, IndexError, TypeError, FloatingPointError, np.linalg.LinAlgError) as error:
        raise InputError(f"{path}: its parts do not fit together ({error})") from None
    if not all(np.all(np.isfinite(array)) for array in arrays) or not np.all(
        np.abs(path_T.positions) <= FARTHEST
    ):
        raise InputError(f"{path}: the movement leads farther than {FARTHEST:g} m, or nowhere")
    return primitive


def check_joint_movement(primitive: JointPrimitive, path: Path) -> None:
    """Rolls a joint-space primitive out once, coarsely.

    Args:
        primitive: As read.
        path: Its file, for errors.

    Raises:
        InputError: It takes too long, has inconsistent parts, or leads beyond any joint's range.
    """
    _check_duration(primitive.duration, primitive.transformation, path)
    _check_gain(primitive.transformation, "transformation", path)
    try:
        with np.errstate(all="ignore"):
            joints = primitive.rollout(time_step=primitive.duration / _STEPS).joints
    except (ValueError, IndexError, TypeError, FloatingPointError, np.linalg.LinAlgError) as error:
        raise InputError(f"{path}: its parts do not fit together ({error})") from None
    if not np.all(np.abs(joints) <= 2 * np.pi):
        raise InputError(f"{path}: the movement leads beyond any joint, or nowhere")


def _check_duration(duration: float, part: TransformationModel, path: Path) -> None:
    if not SHORTEST <= duration <= LONGEST:
        raise InputError(
            f"{path}: duration: {duration:g} s; it must be {SHORTEST:g} to {LONGEST:g} s"
        )
    if 100.0 * duration * len(part.model.to_data()["weights"]) > _MOST_NUMBERS:
        raise InputError(f"{path}: duration: {duration:g} s is too long for so many weights")


def _check_gain(part: TransformationModel, name: str, path: Path) -> None:
    if not 0.1 <= part.alpha_z <= 1e3:
        raise InputError(f"{path}: {name}.alpha_z: {part.alpha_z:g} must be 0.1 to 1000")
