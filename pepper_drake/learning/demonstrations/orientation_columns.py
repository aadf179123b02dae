"""The orientation columns of a file: the order of a quaternion, the unit of angles."""

from typing import TypeGuard

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.arm_chain import arm_chain
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.demonstrations.importers.options import ANGLES, ImportOptions
from pepper_drake.learning.demonstrations.importers.track import Track
from pepper_drake.learning.demonstrations.refusals import FARTHEST, HAND_TURN, turn_between

Array = npt.NDArray[np.float64]

_FITS, _MISSES = 2e-3, 0.02
"""Poses closer than the first [m] to the nearest that the arm can take count as the hand's, those
farther than the second do not; a radian counts 0.1 m."""

_MOST_TURN = 2.2 * np.pi
"""Roll, pitch and yaw beyond this [rad] are degrees: a hand does not turn more than a full turn."""


def read_rotations(
    track: Track,
    options: ImportOptions,
    arm: str | None,
    joints: Array | None,
    positions: Array | None,
    notes: list[str],
) -> tuple[Array | None, Array | None]:
    """Returns unit quaternions w, x, y, z (N, 4), and the angles (N, 9) if the file has angles.

    Args:
        track: The columns of the file.
        options: The user's order and unit, which override the file's.
        arm: The arm of `joints`, None where there are none.
        joints: Joint angles (N, J) [rad].
        positions: Positions of the hand (N, 2 or 3) [m].
        notes: A line is appended for what was inferred.

    Raises:
        InputError: With file, line and what to do.
    """
    if track.angles is not None:
        return _from_angles(track, options, arm, joints, positions, notes)
    q = track.rotations
    if q is None:
        return None, None
    norms = np.linalg.norm(q, axis=1)
    wrong = np.flatnonzero(np.abs(norms - 1.0) > 1e-2)
    if len(wrong):
        k = int(wrong[0])
        raise InputError(
            f"{track.where(k)}: the quaternion's norm is {norms[k]:.4g}, not 1; the columns must be"
            " a unit quaternion"
        )
    q = so3.make_continuous(q if track.quaternion == "wxyz" else so3.normalize(q))
    orders = {"wxyz": q, "xyzw": q[:, [3, 0, 1, 2]]}
    order = options.quaternion or track.quaternion
    if options.quaternion is None and _in_torso(track, options):
        named = track.quaternion is not None and not track.kind.startswith("poses")
        found = None if named else _order_by_arm(orders, arm, joints, positions)
        if found is not None and found != order:
            order = found
            notes.append(
                f"quaternions are {found}: Pepper's arm reaches the poses in no other order"
            )
        elif order is not None:
            others = {name: r for name, r in orders.items() if name != order}
            inverse = {f"{order} of the inverse rotation": so3.conjugate(orders[order])}
            _refuse_other_reading(track, orders[order], others | inverse, joints, positions, notes)
    if order is None:
        raise InputError(
            f"{track.path}: the order of the quaternion's columns is not said, and both are"
            " possible; say --quaternion wxyz or --quaternion xyzw"
        )
    return orders[order], None


def _order_by_arm(
    orders: dict[str, Array], arm: str | None, joints: Array | None, positions: Array | None
) -> str | None:
    """Returns the order in which the orientations are those of Pepper's hand, None if unsure.

    It is found with forward kinematics if the arm's joints are known, otherwise by which poses an
    arm of five joints can take: in the wrong order it can take none.
    """
    if joints is not None and arm is not None and joints.shape[1] == 5:
        hand = arm_chain(arm).hand(joints)[1]
        turns = {name: turn_between(hand, r) for name, r in orders.items()}
        best = min(turns, key=lambda name: turns[name])
        return best if turns[best] < HAND_TURN < max(turns.values()) else None
    if not _may_be_a_hand(positions):
        return None
    misses = {name: _miss(positions, r) for name, r in orders.items()}
    best = min(misses, key=lambda name: misses[name])
    return best if misses[best] < _FITS and max(misses.values()) > _MISSES else None


def _refuse_other_reading(
    track: Track,
    rotations: Array,
    others: dict[str, Array],
    joints: Array | None,
    positions: Array | None,
    notes: list[str],
) -> None:
    """Refuses orientations that Pepper's hand cannot have, if another reading of them fits.

    If none fits, as with another grip or frame, a note says so. With joints nothing is done here:
    the check of the demonstration compares orientation and joints.
    """
    if joints is not None or not _may_be_a_hand(positions):
        return
    if _miss(positions, rotations) < _MISSES:
        return
    for name, other in others.items():
        if _miss(positions, other) < _FITS:
            raise InputError(
                f"{track.path}: Pepper's hand cannot be turned so at these positions, but it can if"
                f" the orientation is read as {name}; write it as a quaternion qw, qx, qy, qz of"
                " the hand in the torso frame, or say --quaternion if it is right"
            )
    notes.append(
        "Pepper's hand cannot be turned so at these positions: another grip, or another frame?"
    )


def _in_torso(track: Track, options: ImportOptions) -> bool:
    """Tells whether neither file nor user says that the poses are not in the torso frame."""
    return (
        track.frame in (None, "torso", "base_link")
        and options.frame in (None, "torso")
        and (options.start, options.up, options.unit) == (None, None, None)
    )


def _may_be_a_hand(positions: Array | None) -> TypeGuard[Array]:
    return (
        positions is not None
        and positions.shape[1] == 3
        and float(np.linalg.norm(positions, axis=1).max()) <= FARTHEST
    )


def _miss(positions: Array, rotations: Array) -> float:
    """Returns the largest distance of four of the poses from those that the better arm can take."""
    count = len(positions)
    samples = sorted({0, count // 3, 2 * count // 3, count - 1})
    right = positions[:, 1].mean() < 0.0
    nearest = np.inf
    for arm in ("right", "left") if right else ("left", "right"):
        if nearest > _FITS:
            away = arm_chain(arm).pose_distances(positions[samples], rotations[samples])
            nearest = min(nearest, float(away.max()))
    return nearest


def _from_angles(
    track: Track,
    options: ImportOptions,
    arm: str | None,
    joints: Array | None,
    positions: Array | None,
    notes: list[str],
) -> tuple[Array, Array | None]:
    assert track.angles is not None
    assert track.times is not None
    unit = options.angle or track.angle_unit
    if unit == "deg" and track.angle_unit is None and arm is not None and joints is not None:
        hand = arm_chain(arm).hand(joints)[1]
        if turn_between(hand, so3.from_angles(track.angles[:, :3])) < HAND_TURN:
            unit = "rad"  # Only the joints are in degrees.
    values = track.angles * ANGLES[unit or "rad"]
    if unit == "deg":
        notes.append("angles in degrees")
    elif unit is None:
        k, j = np.unravel_index(int(np.argmax(np.abs(values[:, :3]))), (len(values), 3))
        if abs(values[k, j]) > _MOST_TURN:
            raise InputError(
                f"{track.where(int(k))}: an angle of {values[k, j]:.4g} rad is more than a turn;"
                " are they degrees (--angle deg)?"
            )
    if options.angle is None and _in_torso(track, options):
        roll, pitch, yaw = values[:, :3].T
        others = {
            "turns about the hand's own axes x, y, z": so3.conjugate(
                so3.from_angles(-values[:, [0, 1, 2]])
            ),
            "yaw, pitch, roll": so3.from_angles(np.column_stack((yaw, pitch, roll))),
        }
        if unit is None:
            others["angles in degrees (--angle deg)"] = so3.from_angles(np.radians(values[:, :3]))
        shown = so3.from_angles(values[:, :3])
        _refuse_other_reading(track, shown, others, joints, positions, notes)
    values[:, :3] = np.unwrap(values[:, :3], axis=0)
    try:
        motion = Demonstration.from_positions(
            track.times,
            values[:, :3],
            values[:, 3:6] if values.shape[1] >= 6 else None,
            values[:, 6:9] if values.shape[1] >= 9 else None,
            name="angles",
        )
    except InputError as error:
        raise InputError(f"{track.path}: {error}") from None
    angles = np.hstack((motion.positions, motion.velocities, motion.accelerations))
    return so3.make_continuous(so3.from_angles(motion.positions)), angles
