"""Measurements of a robot, by its own clock and by ours."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.models.pepper import BODY_JOINTS
from pepper_drake.naoqi.clock import MeasurementHistory

Vector = npt.NDArray[np.float64]

CLOCK_JUMP = 0.5
"""Largest gain of the robot's clock on ours between two answers [s]."""
_N = len(BODY_JOINTS)


@dataclass(frozen=True)
class Measurement:
    """One state of the robot.

    Attributes:
        robot_time: Time of the measurement by the robot's clock [s].
        time: The same by ours [s].
        positions: Joint positions in the order of `BODY_JOINTS` (15,) [rad].
        base_pose: x, y [m], yaw [rad] by its odometry (3,).
    """

    robot_time: float
    time: float
    positions: Vector
    base_pose: Vector


class Measurements:
    """The measurements of the last two seconds.

    Every answer has the robot's time stamp, so that images are matched with joints by the robot's
    clock alone, regardless of drift or of a simulated robot's slow clock.
    """

    def __init__(self) -> None:
        self._history = MeasurementHistory()
        self._newest: Measurement | None = None
        self._changed = -np.inf

    @property
    def newest(self) -> Measurement | None:
        """The newest measurement, or None."""
        return self._newest

    @property
    def still_for(self) -> float:
        """Time by the robot's clock since any joint's measurement changed [s]."""
        return 0.0 if self._newest is None else self._newest.robot_time - self._changed

    def excuse(self, duration: float) -> None:
        """Restarts `still_for` at a duration [s] from now, by the robot's clock."""
        if self._newest is not None:
            self._changed = self._newest.robot_time + duration

    def add(self, measurement: Measurement) -> None:
        """Adds a measurement; one with the last one's time stamp is ignored.

        Raises:
            LinkFault: The robot's clock jumped.
        """
        last = self._newest
        if last is not None:
            passed = measurement.robot_time - last.robot_time
            if passed < 0.0 or passed > measurement.time - last.time + CLOCK_JUMP:
                raise LinkFault("clock_jump", f"by {passed:.1f} s within a moment")
            if passed == 0.0:
                return
        if last is None or not np.array_equal(measurement.positions, last.positions):
            self._changed = max(self._changed, measurement.robot_time)
        self._newest = measurement
        row = (measurement.positions, measurement.base_pose, [measurement.time])
        self._history.add(measurement.robot_time, np.concatenate(row))

    def at(self, robot_time: float) -> Measurement | None:
        """Interpolates at a time of the robot's clock; None outside the history."""
        row = self._history.at(robot_time)
        if row is None:
            return None
        return Measurement(robot_time, float(row[-1]), row[:_N], row[_N:-1])
