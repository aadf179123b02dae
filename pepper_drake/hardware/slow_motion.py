"""Slow motions of a robot without perception: along postures, and back along a path."""

import numpy as np
import numpy.typing as npt

from pepper_drake.diagrams.calibration_run import CalibrationMotion
from pepper_drake.models.control_model import CONTROL_PERIOD

Vector = npt.NDArray[np.float64]

SLOW = 0.3
"""Largest speed of a joint [rad/s]."""
STANDS = 0.3
"""Time at rest before and after [s]."""
_RAMP = 0.5
"""Time of acceleration, and of braking [s]."""
_SAME = 0.02
"""Postures whose joints differ by less count as equal [rad]."""


def slow_motion(postures: Vector) -> CalibrationMotion:
    """Returns the motion along postures (N, 15) [rad], at rest at the first and the last."""
    steps = np.abs(np.diff(postures, axis=0)).max(axis=1)
    lengths = np.concatenate(([0.0], np.cumsum(steps)))
    count = max(int(np.ceil(lengths[-1] / (SLOW * CONTROL_PERIOD))), 1)
    ramp = np.hanning(round(_RAMP / CONTROL_PERIOD) + 2)[1:-1]
    advances = np.convolve(np.full(count, lengths[-1] / count), ramp / ramp.sum())
    at = np.concatenate(([0.0], np.cumsum(advances)))
    times = STANDS + CONTROL_PERIOD * np.arange(len(at), dtype=np.float64)
    rows = [np.interp(at, lengths, joint) for joint in postures.T]
    return CalibrationMotion(times, np.column_stack(rows), ())


def retraced_path(path: Vector) -> Vector:
    """Returns the postures (M, n) from the last of a path (N, n) to its first [rad].

    Loops, where the path returned to an earlier posture, are left out.
    """
    here = len(path) - 1
    back = [here]
    while here > 0:
        same = np.abs(path[:here] - path[here]).max(axis=1) <= _SAME
        here = int(np.argmax(same)) if same.any() else here - 1
        back.append(here)
    return path[back]
