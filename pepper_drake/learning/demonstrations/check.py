"""Checks of a demonstration before anything is learned from it.

`examine` measures it and warns of what is doubtful, naming the sample (or the line of the file);
`refusals` refuses what cannot be right.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from pepper_drake.errors import InputError
from pepper_drake.learning.demonstrations.arm_chain import arm_chain, arm_of
from pepper_drake.learning.demonstrations.conditioning import measure_noise
from pepper_drake.short_repr import short_repr, short_signature

if TYPE_CHECKING:
    from pepper_drake.learning.demonstrations.demonstration import Demonstration

Array = npt.NDArray[np.float64]
Where = Callable[[int], str]


@dataclass(frozen=True)
class DemonstrationReport:
    """Measurements of a demonstration.

    Attributes:
        name: Of the demonstration.
        samples: Their number.
        duration: [s].
        rate: Samples a second, by the median step [Hz].
        jitter: Standard deviation of the step, by its median.
        longest_gap: Between two samples [s].
        path_length: [m].
        mean_speed: [m/s].
        top_speed: [m/s].
        noise: Standard deviation of the positions [m]; 0 where it cannot be told from motion.
        reach: Farthest distance of the hand from the nearer shoulder [m], in the torso frame.
        arm_reach: What Pepper's arm reaches [m].
        within_reach: Share of samples within `arm_reach`.
        joints: Names.
        read_as: How the file was interpreted.
        warnings: Doubtful points, with the sample.
    """

    name: str
    samples: int
    duration: float
    rate: float
    jitter: float
    longest_gap: float
    path_length: float
    mean_speed: float
    top_speed: float
    noise: float
    reach: float
    arm_reach: float
    within_reach: float
    joints: tuple[str, ...] = ()
    read_as: tuple[str, ...] = ()
    warnings: tuple[str, ...] = field(default=())

    __repr__ = short_repr
    __signature__ = short_signature

    def to_data(self) -> dict[str, Any]:
        """Returns the report as plain data."""
        data = asdict(self)
        return {key: list(v) if isinstance(v, tuple) else v for key, v in data.items()}

    def lines(self) -> list[str]:
        """Returns the report as lines to print."""
        out = [f"{self.name}: {note}" for note in self.read_as]
        out.append(
            f"{self.name}: {self.samples} samples at {self.rate:.3g} Hz, {self.duration:.2f} s,"
            f" {self.path_length:.2f} m, at most {self.top_speed:.2f} m/s,"
            f" {100 * self.within_reach:.0f} % within the arm's reach"
        )
        return out + [f"{self.name}: warning: {warning}" for warning in self.warnings]


def examine(demonstration: Demonstration, where: Where | None = None) -> DemonstrationReport:
    """Measures a demonstration.

    Args:
        demonstration: What was recorded.
        where: Names a sample in warnings; "sample 3" if left out.
    """
    label = where or (lambda sample: f"sample {sample + 1}")
    t, p = demonstration.times, demonstration.positions
    steps = np.diff(t)
    step = float(np.median(steps))
    speeds = np.linalg.norm(np.diff(p, axis=0), axis=1) / steps
    shoulders = [arm_chain(arm).shoulder for arm in ("left", "right")]
    far = np.min([np.linalg.norm(p - shoulder, axis=1) for shoulder in shoulders], axis=0)
    length = arm_chain("right").length
    noise = measure_noise(t, p)
    warnings = list(_warn_times(steps, step, label))
    warnings += _warn_motion(demonstration, far, length, speeds, label)
    return DemonstrationReport(
        name=demonstration.name,
        samples=len(t),
        duration=demonstration.duration,
        rate=1.0 / step,
        jitter=float(np.std(steps)) / step,
        longest_gap=float(steps.max()),
        path_length=demonstration.path_length,
        mean_speed=demonstration.path_length / demonstration.duration,
        top_speed=float(speeds.max()),
        noise=noise.deviation,
        reach=float(far.max()),
        arm_reach=length,
        within_reach=float(np.mean(far <= length + 0.01)),
        joints=demonstration.joint_names,
        read_as=demonstration.notes,
        warnings=tuple(warnings),
    )


def _warn_times(steps: Array, step: float, label: Where) -> list[str]:
    warnings = []
    gaps = np.flatnonzero(steps > max(5.0 * step, 0.1))
    for k in gaps[:3]:
        warnings.append(
            f"{label(int(k) + 1)}: a gap of {steps[k]:.2g} s before it, across which the path is"
            " interpolated"
        )
    if len(gaps) > 3:
        warnings.append(f"{len(gaps) - 3} more gaps")
    jitter = float(np.std(steps[steps <= 5.0 * step])) / step
    if jitter > 0.3:
        warnings.append(f"the time between samples varies by {100 * jitter:.0f} %")
    if 1.0 / step < 10.0:
        warnings.append(f"{1.0 / step:.2g} samples a second; what lies between is made up")
    return warnings


def _warn_motion(
    demonstration: Demonstration, far: Array, length: float, speeds: Array, label: Where
) -> list[str]:
    warnings = []
    beyond = np.flatnonzero(far > length + 0.01)
    if len(beyond):
        k = int(beyond[0])
        warnings.append(
            f"{label(k)}: {far[k]:.2f} m from the shoulder, the arm reaches {length:.2f} m"
            f" ({len(beyond)} of {len(far)} samples); positions above the floor need the frame"
            " base_footprint"
        )
    still = np.all(np.diff(demonstration.positions, axis=0) == 0.0, axis=1)
    moving = speeds > 0.02
    repeated = still[1:-1] & moving[:-2] & moving[2:]
    if len(repeated) and repeated.mean() > 0.02:
        k = int(np.argmax(repeated)) + 2
        warnings.append(f"{label(k)}: the same position as before while the hand moves")
    arm = arm_of(demonstration.joint_names)
    if arm is not None and demonstration.joints is not None:
        rates = (
            np.abs(np.diff(demonstration.joints, axis=0)) / np.diff(demonstration.times)[:, None]
        )
        over = rates > arm_chain(arm).speed
        if over.any():
            k, j = (int(v[0]) for v in np.nonzero(over))
            warnings.append(
                f"{label(k + 1)}: {demonstration.joint_names[j]} at {rates[k, j]:.1f} rad/s, its"
                f" limit is {arm_chain(arm).speed[j]:.1f} rad/s"
            )
    return warnings


def refuse_out_of_reach(demonstration: Demonstration, name: str) -> None:
    """Refuses a motion none of whose samples is within the arm's reach.

    Raises:
        InputError: No sample is within reach; the message says what to do.
    """
    report = examine(demonstration)
    if report.within_reach == 0.0:
        raise InputError(
            f"{name}: no position is within the arm's reach, {report.arm_reach:.2f} m from the"
            f" shoulder (up to {report.reach:.2f} m); positions above the floor need import.py"
            " --frame base_footprint"
        )
