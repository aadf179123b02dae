"""Demonstrations as text files.

Four forms are read; all have one row per sample, separated by white space, `#` starts a comment:

- a folder with `translation.txt` (time, 3 positions, 3 velocities, 3 accelerations) and, if the
  orientation is known, `rotation.txt` (time, roll, pitch, yaw, their rates, their accelerations),
  and `joints.csv` (a header `time,NAME,...`) where joints were recorded; or one in which a
  recording was interrupted (see `recording`);
- a text file with the ten columns of `translation.txt`; an orientation is taken from
  `NAME_pose.txt` beside `NAME.txt` if there is one;
- a file `NAME_pose.txt`: time, position, unit quaternion w, x, y, z.

In the ten-column files accelerations, or velocities and accelerations, may be left out: they are
then derived. Units are s, m [rad].
"""

from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.files import read_text, write_atomically
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.demonstration import RECORDED, Demonstration
from pepper_drake.learning.demonstrations.recording import read_partial
from pepper_drake.learning.demonstrations.text_files import format_table, parse_table

Array = npt.NDArray[np.float64]

TRANSLATION = "translation.txt"
ROTATION = "rotation.txt"
JOINTS = "joints.csv"
POSE_SUFFIX = "_pose.txt"

_COLUMNS = (4, 7, 10)
_TRANSLATION_MEANING = "time, 3 positions, 3 velocities, 3 accelerations"
_ROTATION_MEANING = "time, 3 angles, 3 rates, 3 accelerations"
_POSE_MEANING = "time, 3 positions, quaternion w x y z"


def read_demonstration(path: Path) -> Demonstration:
    """Reads any of the forms.

    Raises:
        InputError: With file, line and how to mend it.
    """
    if path.is_dir():
        return read_partial(path) or _read_folder(path)
    if path.name.endswith(POSE_SUFFIX):
        table, quaternions = _read_pose(path)
        return Demonstration.from_positions(
            table[:, 0], table[:, 1:4], rotations=quaternions, name=path.name[: -len(POSE_SUFFIX)]
        )
    table = parse_table(read_text(path), path, _COLUMNS, _TRANSLATION_MEANING)
    pose_path = path.with_name(path.stem + POSE_SUFFIX)
    rotations: Array | None = None
    if pose_path.exists():
        pose, rotations = _read_pose(pose_path)
        _check_times(pose[:, 0], table[:, 0], pose_path, path)
    return _from_table(table, path.stem, rotations)


def write_demonstration(demonstration: Demonstration, path: Path) -> None:
    """Writes a folder, a `NAME_pose.txt`, or (any other .txt) ten columns.

    Numbers are written in the shortest form that reads back the same. Ten columns of a motion
    with orientation are accompanied by `NAME_pose.txt`. A folder's `rotation.txt` has the angles
    that were recorded, else those of the quaternions.

    Raises:
        InputError: A pose file is asked for but the orientation is unknown, or writing failed.
    """
    if path.name.endswith(POSE_SUFFIX):
        _write_pose(demonstration, path)
    elif path.suffix == ".txt":
        write_atomically(path, _translation_text(demonstration))
        if demonstration.rotations is not None:
            _write_pose(demonstration, path.with_name(path.stem + POSE_SUFFIX))
    else:
        write_atomically(path / TRANSLATION, _translation_text(demonstration))
        if demonstration.rotations is not None:
            angles = demonstration.angles
            if angles is None:
                angles = _derive_angles(demonstration.times, demonstration.rotations)
            table = np.column_stack((demonstration.times, angles))
            header = "# time [s], roll pitch yaw [rad], rates [rad/s], accelerations [rad/s^2]\n"
            write_atomically(path / ROTATION, header + format_table(table))
        else:
            (path / ROTATION).unlink(missing_ok=True)  # An earlier demonstration's.
        if demonstration.joints is not None:
            table = np.column_stack((demonstration.times, demonstration.joints))
            header = ",".join(("time", *demonstration.joint_names)) + "\n"
            write_atomically(path / JOINTS, header + format_table(table, ","))
        else:
            (path / JOINTS).unlink(missing_ok=True)


def _read_folder(path: Path) -> Demonstration:
    translation = path / TRANSLATION
    table = parse_table(read_text(translation), translation, _COLUMNS, _TRANSLATION_MEANING)
    times = table[:, 0]
    rotations = angles = joints = None
    names: tuple[str, ...] = ()
    rotation = path / ROTATION
    if rotation.exists():
        recorded = parse_table(read_text(rotation), rotation, _COLUMNS, _ROTATION_MEANING)
        _check_times(recorded[:, 0], times, rotation, translation)
        recorded[:, 1:4] = np.unwrap(recorded[:, 1:4], axis=0)
        filled = _from_table(recorded, path.name, None)
        angles = np.hstack((filled.positions, filled.velocities, filled.accelerations))
        rotations = so3.make_continuous(so3.from_angles(filled.positions))
    if (path / JOINTS).exists():
        joint_times, joints, names = _read_joints(path / JOINTS)
        _check_times(joint_times, times, path / JOINTS, translation)
    motion = _from_table(table, path.name, rotations)
    return Demonstration(
        times=motion.times,
        positions=motion.positions,
        velocities=motion.velocities,
        accelerations=motion.accelerations,
        rotations=rotations,
        angles=angles,
        joints=joints,
        joint_names=names,
        name=motion.name,
        derivation=motion.derivation,
    )


def _from_table(table: Array, name: str, rotations: Array | None) -> Demonstration:
    width = table.shape[1]
    return Demonstration.from_positions(
        table[:, 0],
        table[:, 1:4],
        table[:, 4:7] if width >= 7 else None,
        table[:, 7:10] if width >= 10 else None,
        rotations=rotations,
        name=name,
    )


def _read_pose(path: Path) -> tuple[Array, Array]:
    table = parse_table(read_text(path), path, (8,), _POSE_MEANING)
    norms = np.linalg.norm(table[:, 4:], axis=1)
    wrong = np.flatnonzero(np.abs(norms - 1.0) > 1e-3)
    if len(wrong):
        raise InputError(
            f"{path}, sample {wrong[0] + 1}: the quaternion's norm is {norms[wrong[0]]:.4g}, not 1;"
            " columns 5 to 8 must be a unit quaternion w, x, y, z"
        )
    return table, table[:, 4:]


def _read_joints(path: Path) -> tuple[Array, Array, tuple[str, ...]]:
    text = read_text(path)
    header, _, body = text.partition("\n")
    names = tuple(name.strip() for name in header.split(","))
    if len(names) < 2 or names[0] != "time" or not all(names):
        raise InputError(f"{path}, line 1: the header must be time,JOINT,... with NAOqi's names")
    # A leading empty line keeps the line numbers in errors right.
    table = parse_table("\n" + body, path, (len(names),), "as named in the header", separator=",")
    return table[:, 0], table[:, 1:], names[1:]


def _check_times(times: Array, reference: Array, path: Path, reference_path: Path) -> None:
    if len(times) != len(reference) or not np.allclose(times, reference, rtol=0.0, atol=1e-6):
        raise InputError(
            f"{path}: its times differ from those of {reference_path.name}; both must have the"
            " same rows"
        )


def _translation_text(demonstration: Demonstration) -> str:
    table = np.column_stack(
        (
            demonstration.times,
            demonstration.positions,
            demonstration.velocities,
            demonstration.accelerations,
        )
    )
    header = "# time [s], position [m], velocity [m/s], acceleration [m/s^2]"
    if demonstration.derivation != RECORDED:
        header += f"; {demonstration.derivation}"
    return header + "\n" + format_table(table)


def _write_pose(demonstration: Demonstration, path: Path) -> None:
    if demonstration.rotations is None:
        raise InputError(f"{path}: the demonstration has no orientation; write NAME.txt instead")
    table = np.column_stack((demonstration.times, demonstration.positions, demonstration.rotations))
    write_atomically(path, "# time [s], position [m], w x y z\n" + format_table(table))


def _derive_angles(times: Array, rotations: Array) -> Array:
    angles = np.unwrap(so3.to_angles(rotations), axis=0)
    motion = Demonstration.from_positions(times, angles)
    return np.hstack((motion.positions, motion.velocities, motion.accelerations))
