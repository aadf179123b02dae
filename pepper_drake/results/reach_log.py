"""The log of one reach: arrays with the units in their names."""

import contextlib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Self

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.models.pepper import BODY_JOINTS
from pepper_drake.naoqi.constants import HANDS
from pepper_drake.results.log_files import check_rows, read_arrays
from pepper_drake.short_repr import short_repr

Vector = npt.NDArray[np.float64]

_HANDS = "hand_opening"
_COLUMNS: dict[str, int | None] = {
    "mode": None,
    "movement_origin": None,
    "joint_position_rad": len(BODY_JOINTS),
    "joint_command_rad": len(BODY_JOINTS),
    "base_pose_m_m_rad": 3,
    "hand_position_torso_m": 3,
    "desired_position_torso_m": 3,
    "goal_position_torso_m": 3,
    "goal_distance_m": None,
    "orientation_error_rad": None,
    "axis_error_rad": None,
    "phase": None,
    "tau_s": None,
    "coupling_m_per_s2": 3,
    "clearance_m": None,
    "seen_clearance_m": None,
}
"""Numbers of columns of arrays with a row for each time; None: one-dimensional."""


@dataclass(frozen=True, eq=False)
class ReachLog:
    """Log of a reach, sampled every 10 ms: N rows. T is the torso frame, W the world.

    Attributes:
        time_s: (N,).
        mode: (N,) the supervisor's `ReachMode`.
        movement_origin: (N,) the `Origin` of the current movement, 0 for none.
        joint_position_rad: (N, 15) measured, in the order of `BODY_JOINTS`.
        joint_command_rad: (N, 15) output of the safety monitor.
        base_pose_m_m_rad: (N, 3) x, y, yaw in W.
        hand_opening: (N, 2) of `HANDS`, from 0, closed, to 1, open; (N, 0) if unknown.
        object_offset_m: (N, 3 K) x, y, z in W of the K moving objects, relative to their places in
            the scene: obstacles in the scene's order, then the goal object.
        hand_position_torso_m: (N, 3) measured.
        desired_position_torso_m: (N, 3) the primitive's.
        goal_position_torso_m: (N, 3) estimated.
        goal_distance_m: (N,) between the hand and the true pre-grasp position.
        orientation_error_rad: (N,) angle between the hand and the true pre-grasp orientation.
        axis_error_rad: (N,) the same for the hand's axis whose direction matters for the task.
        phase: (N,).
        tau_s: (N,).
        coupling_m_per_s2: (N, 3) the coupling term as an acceleration, C_t / tau^2.
        clearance_m: (N,) true smallest distance between Pepper and the obstacles, at most 0.1.
        seen_clearance_m: (N,) the same between the arm and the perceived cloud.
        cloud_torso_m: (P, 3) the cloud when the arm started.
        demonstration_m: (M, 3) the demonstrated path.
        taught_path_torso_m: (K, 3) the taught primitive's path from the arm's start to the (moving)
            goal, neither bent nor adapted; no rows if the arm did not start.
    """

    __repr__ = short_repr

    time_s: Vector
    mode: npt.NDArray[np.int64]
    movement_origin: npt.NDArray[np.int64]
    joint_position_rad: Vector
    joint_command_rad: Vector
    base_pose_m_m_rad: Vector
    object_offset_m: Vector
    hand_position_torso_m: Vector
    desired_position_torso_m: Vector
    goal_position_torso_m: Vector
    goal_distance_m: Vector
    orientation_error_rad: Vector
    axis_error_rad: Vector
    phase: Vector
    tau_s: Vector
    coupling_m_per_s2: Vector
    clearance_m: Vector
    seen_clearance_m: Vector
    cloud_torso_m: Vector
    demonstration_m: Vector
    taught_path_torso_m: Vector
    hand_opening: Vector

    def save(self, path: Path, *, compress: bool = True) -> None:
        """Writes all arrays into one file; writing is faster without compression."""
        save = np.savez_compressed if compress else np.savez
        save(path, **{f.name: getattr(self, f.name) for f in fields(self)})

    @classmethod
    def load(cls, path: Path) -> Self:
        """Reads a file that `save` wrote.

        Raises:
            InputError: The file is missing, not a log, or an array is missing or of wrong shape.
        """
        required = [f.name for f in fields(cls) if f.name != _HANDS]
        arrays = read_arrays(path, required)
        with contextlib.suppress(InputError):  # Older logs lack the hands.
            arrays |= read_arrays(path, [_HANDS])
        hands = arrays.setdefault(_HANDS, np.zeros((len(arrays["time_s"]), 0)))
        for name in ("cloud_torso_m", "demonstration_m", "taught_path_torso_m"):
            points = arrays[name]
            if points.ndim != 2 or points.shape[1] != 3 or not np.all(np.abs(points) < 1e3):
                raise InputError(f"{path}: {name} must be rows of x y z; record the run again")
        offsets = arrays["object_offset_m"]
        objects = offsets.shape[1] // 3 if offsets.ndim == 2 else 1
        width = len(HANDS) if hands.size else 0
        check_rows(path, arrays, {**_COLUMNS, "object_offset_m": 3 * objects, _HANDS: width})
        whole = {name: arrays[name] for name in ("mode", "movement_origin")}
        for name, values in whole.items():
            if not np.all((values >= 0) & (values < 100) & (values == np.round(values))):
                raise InputError(f"{path}: {name} must hold whole numbers; record the run again")
        mode, origin = (values.astype(np.int64) for values in whole.values())
        others = {name: array for name, array in arrays.items() if name not in whole}
        return cls(mode=mode, movement_origin=origin, **others)
