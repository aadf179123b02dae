"""The orientation columns of a file: the order of a quaternion, the unit of angles."""

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.arm_chain import ARMS, arm_chain
from pepper_drake.learning.demonstrations.check import FARTHEST, HAND_TURN, turn_between
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.demonstrations.importers.options import ANGLES, ImportOptions
from pepper_drake.learning.demonstrations.importers.track import Track

Array = npt.NDArray[np.float64]

_MOST_TURN = 2.2 * np.pi
"""Roll, pitch and yaw beyond this [rad] are degrees: a hand does not turn more than once."""


def read_rotations(
    track: Track,
    options: ImportOptions,
    arm: str | None,
    joints: Array | None,
    positions: Array | None,
    notes: list[str],
) -> tuple[Array | None, Array | None]:
    """Returns unit quaternions w, x, y, z (N, 4), and the angles (N, 9) where there are.

    Args:
        track: The columns of the file.
        options: The user's word on order and unit; it goes before what the file says.
        arm: The arm of `joints`, None where there are none.
        joints: Joint angles (N, J) [rad].
        positions: Positions of the hand (N, 2 or 3) [m].
        notes: Takes a line for each thing that was found out rather than said.

    Raises:
        InputError: With file, line and the mend.
    """
    if track.angles is not None:
        return _from_angles(track, options, arm, joints, notes)
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
    order = options.quaternion or track.quaternion
    if options.quaternion is None and track.frame is None:
        found = _order_by_arm(track, q, arm, joints, positions)
        if found is not None and found != order:
            order = found
            notes.append(
                f"quaternions are {found}: Pepper's arm reaches the poses in no other order"
            )
    if order is None:
        raise InputError(
            f"{track.path}: the order of the quaternion's columns is not said, and both are"
            " possible; say --quaternion wxyz or --quaternion xyzw"
        )
    return (q if order == "wxyz" else q[:, [3, 0, 1, 2]]), None


def _order_by_arm(
    track: Track, q: Array, arm: str | None, joints: Array | None, positions: Array | None
) -> str | None:
    """Returns the order in which the orientations are those of Pepper's hand, None if unsure.

    With the arm's joints by forward kinematics; without, by the poses that an arm of five joints
    can take: a wrong order is none of them.
    """
    if track.quaternion is not None and not track.kind.startswith("poses"):
        return None  # The names of the columns say it.
    orders = {"wxyz": q, "xyzw": q[:, [3, 0, 1, 2]]}
    if joints is not None and arm is not None and joints.shape[1] == 5:
        hand = arm_chain(arm).hand(joints)[1]
        turns = {name: turn_between(hand, r) for name, r in orders.items()}
        best = min(turns, key=lambda name: turns[name])
        return best if turns[best] < HAND_TURN < max(turns.values()) else None
    if positions is None or positions.shape[1] != 3:
        return None
    if float(np.linalg.norm(positions, axis=1).max()) > FARTHEST:
        return None
    samples = sorted({0, len(q) // 3, 2 * len(q) // 3, len(q) - 1})
    for name, r in orders.items():
        other = orders["xyzw" if name == "wxyz" else "wxyz"]
        for side in ARMS if arm is None else (arm,):
            chain = arm_chain(side)
            if all(chain.pose_distance(positions[k], r[k]) < 2e-3 for k in samples):
                misses = [
                    min(arm_chain(s).pose_distance(positions[k], other[k]) for s in ARMS)
                    for k in samples
                ]
                return name if max(misses) > 0.02 else None
    return None


def _from_angles(
    track: Track, options: ImportOptions, arm: str | None, joints: Array | None, notes: list[str]
) -> tuple[Array, Array | None]:
    assert track.angles is not None
    assert track.times is not None
    unit = options.angle or track.angle_unit
    if unit == "deg" and track.angle_unit is None and arm is not None and joints is not None:
        hand = arm_chain(arm).hand(joints)[1]
        if turn_between(hand, so3.from_angles(track.angles[:, :3])) < HAND_TURN:
            unit = "rad"  # What is in degrees is the joints.
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
