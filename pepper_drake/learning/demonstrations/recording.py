"""Recordings that survive interruption.

During recording, samples go to `recording.partial.csv` in the demonstration's folder, whole rows at
a time; at the end the demonstration's own files replace it. A killed process leaves the partial
file behind. `Demonstration.load` reads it too: as long as it exists, it is the latest recording.
"""

import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from time import monotonic
from types import TracebackType
from typing import Self

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError, StoppedError
from pepper_drake.files import path_inside, read_bytes
from pepper_drake.learning.demonstrations.demonstration import Demonstration
from pepper_drake.learning.demonstrations.refusals import (
    refuse_far,
    refuse_impossible,
    refuse_rest,
)
from pepper_drake.learning.demonstrations.text_files import format_table, parse_table

Array = npt.NDArray[np.float64]

PARTIAL = "recording.partial.csv"
"""Header `time,x,y,z,qw,qx,qy,qz,JOINT,...`, then a row for each sample [s, m, rad], in T."""

CUTOFF = 10.0
"""Frequency at which the filter of recordings halves the amplitude [Hz]: above intended motion of
the hand, below the jitter of whatever guides it."""

REST_SPEED, REST_TURN_RATE = 0.005, 0.06
"""Below these [m/s, rad/s] a guided hand is at rest."""

_POSE = ("time", "x", "y", "z", "qw", "qx", "qy", "qz")
_FEWEST = 5
_LARGEST = 2**28
"""Largest partial file [bytes]: four hours at 100 Hz."""
_SYNC_PERIOD = 1.0


def recorded_demonstration(
    times: npt.ArrayLike,
    samples: npt.ArrayLike,
    joint_names: Sequence[str],
    *,
    name: str = "recording",
    cutoff: float = CUTOFF,
) -> Demonstration:
    """Makes a demonstration from samples of the hand.

    Velocities and accelerations are the derivatives of the cubic smoothing spline through the
    samples, whose frequency response is 1 / (1 + (f / cutoff)⁴), without lag; see
    `Demonstration.smoothed`.

    Args:
        times: (N,) [s].
        samples: (N, 7 + J) position [m], unit quaternion w, x, y, z, and joints [rad].
        joint_names: J names.
        name: Of the demonstration.
        cutoff: [Hz].

    Raises:
        InputError: There are fewer than five samples.
    """
    rows = np.asarray(samples, dtype=float)
    if len(rows) < _FEWEST:
        raise InputError(f"{name}: {len(rows)} samples; a recording needs at least {_FEWEST}")
    return Demonstration.from_positions(
        times,
        rows[:, :3],
        rotations=rows[:, 3:7],
        joints=rows[:, 7:],
        joint_names=tuple(joint_names),
        name=name,
    ).smoothed(cutoff)


class RecordingWriter:
    """Writes samples as they arrive, then the demonstration; use it in a `with` statement.

    Leaving the `with` statement before `finish` keeps the partial file.

    Args:
        folder: The demonstration's; created if needed.
        joint_names: J names of the joints in the samples.

    Raises:
        InputError: The folder cannot be written to, or holds an interrupted recording.
    """

    def __init__(self, folder: Path, joint_names: Sequence[str]) -> None:
        self._folder, self._path = folder, folder / PARTIAL
        self._written = 0
        self._synced = monotonic()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._file = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND)
        except FileExistsError:
            if not folder.is_dir():
                raise InputError(f"{folder}: is a file; give a folder") from None
            raise InputError(
                f"{self._path}: an interrupted recording is still there; keep it with"
                f" record.py --recover {folder}, or delete it"
            ) from None
        except OSError as error:
            raise InputError(f"{self._path}: cannot be written ({error.strerror})") from None
        self._put(",".join((*_POSE, *joint_names)) + "\n")

    def write(self, times: npt.ArrayLike, samples: npt.ArrayLike) -> None:
        """Writes the samples that are new since the last call.

        Args:
            times: (N,) [s] of all samples so far.
            samples: (N, 7 + J) as in `recorded_demonstration`.

        Raises:
            InputError: The file cannot be written to.
        """
        new = slice(self._written, None)
        table = np.column_stack((np.asarray(times)[new], np.asarray(samples)[new]))
        if len(table):
            self._put(format_table(table, ","))
            self._written += len(table)

    def finish(self, demonstration: Demonstration) -> None:
        """Writes the demonstration's files, each atomically, and then removes the partial one.

        Raises:
            InputError: A file cannot be written to.
        """
        demonstration.save(self._folder)
        self._path.unlink(missing_ok=True)

    def finish_motion(
        self, record: Callable[[], Demonstration]
    ) -> tuple[Demonstration, Demonstration]:
        """Writes the recording without the rest at both ends, or nothing if the hand never moved.

        Args:
            record: Makes a demonstration from all samples.

        Returns:
            The whole recording, and the motion that was written.

        Raises:
            StoppedError: The hand has not moved.
            InputError: A file cannot be written to.
        """
        try:
            recorded = record()
            refuse_rest(recorded.positions, recorded.rotations, str)
        except InputError:
            self.discard()
            raise StoppedError(
                "the recording ended before it held a motion; nothing was kept"
            ) from None
        motion = without_rest(recorded)
        self.finish(motion)
        return recorded, motion

    def discard(self) -> None:
        """Removes the partial file."""
        self._path.unlink(missing_ok=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        os.close(self._file)

    def _put(self, text: str) -> None:
        """Passes whole rows to the operating system: they survive if this process is killed."""
        data = memoryview(text.encode())
        try:
            while data:
                data = data[os.write(self._file, data) :]
            if monotonic() - self._synced > _SYNC_PERIOD:
                os.fsync(self._file)  # They survive a crash of the machine.
                self._synced = monotonic()
        except OSError as error:
            raise InputError(f"{self._path}: cannot be written ({error.strerror})") from None


def read_partial(folder: Path) -> Demonstration | None:
    """Reads an interrupted recording in a folder.

    Returns:
        The demonstration up to the last whole row; None if there is no partial file, or too little
        in it beside a finished demonstration.

    Raises:
        InputError: The file is broken, holds fewer than five samples, or an impossible motion.
    """
    path = folder / PARTIAL
    if not path_inside(folder, PARTIAL).exists():
        return None
    content = read_bytes(path, _LARGEST)
    # The last row may be incomplete; a crash of the machine may have left zeros after it.
    whole, _, _ = content.rstrip(b"\0").rpartition(b"\n")
    header, _, body = whole.decode("utf-8", errors="replace").partition("\n")
    names = tuple(header.split(","))
    count = body.count("\n") + 1 if body else 0
    if count < _FEWEST:
        from pepper_drake.learning.demonstrations.demonstration_files import TRANSLATION

        if (folder / TRANSLATION).exists():
            return None
        raise InputError(
            f"{path}: the recording was interrupted after {count} samples, before it held a"
            " motion; delete it and record again"
        )
    if names[: len(_POSE)] != _POSE:
        raise InputError(f"{path}, line 1: the header must be {','.join(_POSE)},JOINT,...")
    table = parse_table("\n" + body, path, (len(names),), "as named in the header", separator=",")

    def row(sample: int) -> str:
        return f"{path}, line {sample + 2}"

    refuse_far(table[:, 1:4], row)  # Before the filter spreads an outlier over its neighbours.
    try:
        recorded = recorded_demonstration(
            table[:, 0], table[:, 1:], names[len(_POSE) :], name=folder.resolve().name
        )
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    refuse_impossible(recorded, row)
    return recorded


def recover(folder: Path) -> Demonstration:
    """Turns an interrupted recording into a demonstration's files, and removes the partial file.

    Raises:
        InputError: There is no interrupted recording, or it is broken.
    """
    demonstration = read_partial(folder)
    if demonstration is None:
        raise InputError(f"{folder}: no interrupted recording in this folder; check the path")
    demonstration = without_rest(demonstration)
    demonstration.save(folder)
    (folder / PARTIAL).unlink()
    return demonstration


def without_rest(demonstration: Demonstration) -> Demonstration:
    """Returns a recording without the rest at its ends, from time 0.

    One without motion is returned unchanged.
    """
    try:
        motion = demonstration.trimmed(speed=REST_SPEED, turn_rate=REST_TURN_RATE)
    except InputError:
        return demonstration
    return replace(motion, times=np.round(motion.times - motion.times[0], 9))
