"""Demonstrations as files: this project's own formats, and those of other tools.

The project's own formats have one row per sample, separated by white space, `#` starts a comment:

- a folder with `translation.txt` (time, 3 positions, 3 velocities, 3 accelerations) and, if the
  orientation is known, `rotation.txt` (time, roll, pitch, yaw, their rates, their accelerations),
  and, if joints were recorded, `joints.csv` (a header `time,NAME,...`); or `joints.csv` alone, with
  the hand's path from forward kinematics; or a folder with an interrupted recording (see
  `recording`);
- a text file with the ten columns of `translation.txt`; an orientation is taken from
  `NAME_pose.txt` beside `NAME.txt` if there is one;
- a file `NAME_pose.txt`: time, position, unit quaternion w, x, y, z.

In the ten-column files accelerations, or velocities and accelerations, may be left out: they are
derived. Units are s, m, rad, positions in the torso frame. `importers` reads all other formats.
What is read is checked (`check`), and filtered where it is noisy (`conditioning`).
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.files import path_inside, read_text, write_atomically
from pepper_drake.learning import rotations as so3
from pepper_drake.learning.demonstrations.conditioning import CAREFUL
from pepper_drake.learning.demonstrations.demonstration import RECORDED, Demonstration
from pepper_drake.learning.demonstrations.importers import ImportOptions, Track, read_tracks
from pepper_drake.learning.demonstrations.importers.table import check_file
from pepper_drake.learning.demonstrations.interpretation import (
    JointRecording,
    interpret,
    interpret_joints,
)
from pepper_drake.learning.demonstrations.recording import PARTIAL, read_partial
from pepper_drake.learning.demonstrations.text_files import (
    format_table,
    parse_table,
    row_lines,
)

Array = npt.NDArray[np.float64]
Lines = npt.NDArray[np.int64]

TRANSLATION = "translation.txt"
ROTATION = "rotation.txt"
JOINTS = "joints.csv"
POSE_SUFFIX = "_pose.txt"

_COLUMNS = (4, 7, 10)
_TRANSLATION_MEANING = "time, 3 positions, 3 velocities, 3 accelerations"
_ROTATION_MEANING = "time, 3 angles, 3 rates, 3 accelerations"
_POSE_MEANING = "time, 3 positions, quaternion w x y z"


def read_demonstration(path: Path, options: ImportOptions | None = None) -> Demonstration:
    """Reads the one demonstration of a file or a folder.

    Raises:
        InputError: It holds none, several, or one that is wrong; the message says what to do.
    """
    said = options or ImportOptions()
    check_file(path)
    if path.is_dir():
        partial = read_partial(path)
        if partial is not None:
            return partial
    tracks = read_all_tracks(path)
    return interpret(_choose(tracks, said, path), said)


def read_demonstrations(path: Path, options: ImportOptions | None = None) -> list[Demonstration]:
    """Reads all demonstrations of a file or a folder, as bags and data sets hold several.

    Raises:
        InputError: It holds none, or one that is wrong; the message says what to do.
    """
    said = options or ImportOptions()
    check_file(path)
    if said.track is not None or (path.is_dir() and (path / PARTIAL).exists()):
        return [read_demonstration(path, said)]
    return [interpret(track, said) for track in read_all_tracks(path)]


def read_joint_recording(path: Path, options: ImportOptions | None = None) -> JointRecording:
    """Reads the motion of one or more of Pepper's joints, without forward kinematics.

    Raises:
        InputError: There is none, or it is wrong; the message says what to do.
    """
    said = options or ImportOptions()
    return interpret_joints(_choose(read_all_tracks(path), said, path), said)


def read_all_tracks(path: Path) -> list[Track]:
    """Reads the tracks of a file or a folder, before units, order and frame are known.

    Raises:
        InputError: With file, line and what to do.
    """
    check_file(path)
    if path.is_dir() and any((path / name).exists() for name in (TRANSLATION, JOINTS, ROTATION)):
        return [_read_folder(path)]
    if path.is_dir() and not any(path.iterdir()):
        raise InputError(f"{path / TRANSLATION}: no such file; check the path")
    if path.name.endswith(POSE_SUFFIX):
        return [_read_pose_file(path)]
    tracks = read_tracks(path)
    pose_path = path.with_name(path.stem + POSE_SUFFIX)
    if path.suffix == ".txt" and len(tracks) == 1 and pose_path.exists():
        pose = _read_pose_file(path_inside(path.parent, pose_path.name))
        times = tracks[0].times
        if times is not None and pose.times is not None and tracks[0].rotations is None:
            _check_times(pose.times, times, pose_path, path)
            return [replace(tracks[0], rotations=pose.rotations, quaternion="wxyz")]
    return tracks


def _choose(tracks: list[Track], options: ImportOptions, path: Path) -> Track:
    """Returns the selected track, or the only one."""
    names = [track.name for track in tracks]
    shown = ", ".join(names[:8]) + (", ..." if len(names) > 8 else "")
    if options.track is None:
        if len(tracks) == 1:
            return tracks[0]
        raise InputError(
            f"{path}: {len(tracks)} motions in it ({shown}); say which (--track NAME or number)"
        )
    if options.track in names:
        return tracks[names.index(options.track)]
    if options.track.isdecimal() and 1 <= int(options.track[:6]) <= len(tracks):
        return tracks[int(options.track) - 1]
    raise InputError(f"{path}: no motion '{options.track}' in it; there are {shown}")


def write_demonstration(demonstration: Demonstration, path: Path) -> None:
    """Writes a folder, a `NAME_pose.txt`, or (any other .txt) ten columns.

    Numbers are written in the shortest form that reads back the same. Ten columns of a motion
    with orientation are accompanied by `NAME_pose.txt`. A folder's `rotation.txt` has the recorded
    angles, or those of the quaternions.

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
            (path / ROTATION).unlink(missing_ok=True)  # Of an earlier demonstration.
        if demonstration.joints is not None:
            table = np.column_stack((demonstration.times, demonstration.joints))
            header = ",".join(("time", *demonstration.joint_names)) + "\n"
            write_atomically(path / JOINTS, header + format_table(table, ","))
        else:
            (path / JOINTS).unlink(missing_ok=True)


def _read_folder(path: Path) -> Track:
    names_of_files = (TRANSLATION, ROTATION, JOINTS)
    translation, rotation, joint_file = (path_inside(path, name) for name in names_of_files)
    joints: Array | None = None
    names: tuple[str, ...] = ()
    if joint_file.exists():
        times, joints, names, lines = _read_joints(joint_file)
        if not translation.exists() and not rotation.exists():
            return Track(
                joint_file,
                path.resolve().name,
                "joints",
                times,
                joints=joints,
                joint_names=names,
                lines=lines,
            )
    table, lines = _read_table(translation, _COLUMNS, _TRANSLATION_MEANING)
    if joint_file.exists():
        _check_times(times, table[:, 0], joint_file, translation)
    angles = None
    if rotation.exists():
        recorded, _ = _read_table(rotation, _COLUMNS, _ROTATION_MEANING)
        _check_times(recorded[:, 0], table[:, 0], rotation, translation)
        angles = recorded[:, 1:]
    width = min(table.shape[1], _recorded_width(translation))
    return Track(
        translation,
        path.name,
        "a folder of a demonstration",
        table[:, 0],
        table[:, 1:4],
        table[:, 4:7] if width >= 7 else None,
        table[:, 7:10] if width >= 10 else None,
        angles=angles,
        joints=joints,
        joint_names=names,
        lines=lines,
    )


def _recorded_width(path: Path) -> int:
    """Returns how many columns are read: derivatives between few samples are computed again.

    There the second derivative jumps, and is not the derivative of the first.
    """
    header = read_text(path).partition("\n")[0]
    if not header.startswith("#") or CAREFUL not in header:
        return 10
    return 4 if "through the positions" in header else 7


def _read_table(path: Path, columns: tuple[int, ...], meaning: str) -> tuple[Array, Lines]:
    check_file(path)
    text = read_text(path)
    return parse_table(text, path, columns, meaning), row_lines(text)


def _read_pose_file(path: Path) -> Track:
    check_file(path)
    table, quaternions = _read_pose(path)
    return Track(
        path,
        path.name[: -len(POSE_SUFFIX)],
        "poses: time, position, quaternion w x y z",
        table[:, 0],
        table[:, 1:4],
        rotations=quaternions,
        quaternion="wxyz",
        lines=row_lines(read_text(path)),
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


def _read_joints(path: Path) -> tuple[Array, Array, tuple[str, ...], Lines]:
    check_file(path)
    text = read_text(path)
    header, _, body = text.partition("\n")
    names = tuple(name.strip() for name in header.split(","))
    if len(names) < 2 or names[0] != "time" or not all(names):
        raise InputError(f"{path}, line 1: the header must be time,JOINT,... with NAOqi's names")
    # The empty first line keeps line numbers in errors right.
    table = parse_table("\n" + body, path, (len(names),), "as named in the header", separator=",")
    return table[:, 0], table[:, 1:], names[1:], row_lines("\n" + body)


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
