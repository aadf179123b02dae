"""A motion as read from a file, before its units, order and frame are known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from pepper_drake.short_repr import short_repr, short_signature

Array = npt.NDArray[np.float64]
Lines = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Track:
    """N samples; what the file does not state is None.

    Attributes:
        path: The file, for messages.
        name: Of the motion.
        kind: The format, for messages.
        times: (N,) in `time_unit`; None where the file has no times.
        positions: (N, D) in `unit`, D from 1 to 3; None where only joints were recorded.
        velocities: (N, D), in the units of positions and times.
        accelerations: (N, D), in the units of positions and times.
        rotations: (N, 4) quaternions in the order `quaternion`.
        angles: (N, 3), (N, 6) or (N, 9) roll, pitch, yaw, then their rates and accelerations, in
            `angle_unit`.
        joints: (N, J) in `joint_unit`.
        joint_names: J names, as in the file.
        time_unit: s, ms, us, ns, min, h, day.
        unit: m, cm, mm, um, in, ft.
        angle_unit: rad, deg.
        joint_unit: rad, deg.
        quaternion: wxyz or xyzw.
        frame: Name of the frame of positions and rotations.
        lines: (N,) lines of the file, where it has lines.
        notes: Remarks for the user.
        absolute: Whether times may be a clock's; the motion then starts at time 0.
    """

    path: Path
    name: str
    kind: str
    times: Array | None
    positions: Array | None = None
    velocities: Array | None = None
    accelerations: Array | None = None
    rotations: Array | None = None
    angles: Array | None = None
    joints: Array | None = None
    joint_names: tuple[str, ...] = ()
    time_unit: str | None = None
    unit: str | None = None
    angle_unit: str | None = None
    joint_unit: str | None = None
    quaternion: str | None = None
    frame: str | None = None
    lines: Lines | None = None
    notes: tuple[str, ...] = ()
    absolute: bool = True

    __repr__ = short_repr
    __signature__ = short_signature

    @property
    def num_samples(self) -> int:
        """N."""
        for values in (self.times, self.positions, self.joints, self.rotations):
            if values is not None:
                return len(values)
        return 0

    def without_repeats(self) -> Track:
        """Returns the track without rows that repeat the row before, time included."""
        if self.times is None:
            return self
        names = ("times", "positions", "velocities", "accelerations", "rotations", "angles")
        parts = {n: v for n in (*names, "joints") if (v := getattr(self, n)) is not None}
        table = np.column_stack(list(parts.values()))
        kept = np.append(True, np.any(table[1:] != table[:-1], axis=1))
        if kept.all():
            return self
        note = f"{int((~kept).sum())} rows that repeat the row before were left out"
        return replace(
            self,
            lines=None if self.lines is None else self.lines[kept],
            notes=(*self.notes, note),
            **{n: v[kept] for n, v in parts.items()},
        )

    def where(self, sample: int) -> str:
        """Returns file and line of a sample, or its number where there are no lines."""
        if self.lines is not None:
            return f"{self.path}, line {self.lines[sample]}"
        return f"{self.path}, sample {sample + 1}"
