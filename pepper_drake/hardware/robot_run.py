"""A run of a robot: checked before, driven in real time, handed over at the end."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from types import TracebackType
from typing import Self

import numpy as np
import numpy.typing as npt
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Diagram

from pepper_drake.diagrams.calibration_run import CalibrationDrive, CalibrationMotion
from pepper_drake.hardware.dead_man import KEYBOARD
from pepper_drake.hardware.link_config import LinkConfig
from pepper_drake.hardware.link_fault import HANDED_OVER, LINK_FAULTS, LinkFault
from pepper_drake.hardware.link_process import LinkProcess
from pepper_drake.hardware.paced_run import DiagramClock, Pacing, run_paced
from pepper_drake.hardware.preflight import PreflightOptions
from pepper_drake.hardware.slow_motion import STANDS, retraced_path, slow_motion
from pepper_drake.hardware.station import HardwareStation
from pepper_drake.hardware.transport import RobotAccess
from pepper_drake.models.control_model import (
    BODY_JOINTS,
    arm_joints,
    body_indices,
    shared_control_model,
)
from pepper_drake.models.robot_calibration import RobotCalibration

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class HardwareRun:
    """Options of a run with a robot.

    Attributes:
        access: Address and credentials of the robot.
        preflight: Of the checks before.
        should_stop: Asked before each step; if true, the arm is handed over.
        say: Prints a line for the user.
        holds: Whether the arm is held at the end, stiff, instead of handed over.
        clock_rate: Rate of the robot's clock; see `LinkConfig`.
        dead_man: The key to hold meanwhile; see `LinkConfig`.
        protects_arms: Whether the robot's own protection slows its arms; see `LinkConfig`.
    """

    access: RobotAccess
    preflight: PreflightOptions = field(default_factory=PreflightOptions)
    should_stop: Callable[[], bool] = lambda: False
    say: Callable[[str], None] = lambda _: None
    holds: bool = False
    clock_rate: float = 1.0
    dead_man: str = ""
    protects_arms: bool = True


class RobotRun:
    """A driven robot; a context manager that hands it over, whatever happens inside.

    After a run without a fault the arm first retraces its path of the last `advance`: over a table
    it cannot be lowered. A second Ctrl-C, a KeyboardInterrupt, leaves the arm in its position,
    stiff.

    Attributes:
        link: The link.
        clock: The diagram's clock.
        fault: Of the robot or the link, or None.
        is_stopped: Whether the user stopped it.
        was_slowed: Whether the robot's protection slowed its arm.
    """

    def __init__(self, run: HardwareRun, arm: str, **config: object) -> None:
        """Stores the options; entering the context connects.

        Args:
            run: Options of the run.
            arm: "left" or "right": the one that moves.
            config: Other fields of `LinkConfig`.
        """
        self._run, self._arm = run, arm
        self._config = LinkConfig(
            arm,
            clock_rate=run.clock_rate,
            dead_man=run.dead_man,
            protects_arms=run.protects_arms,
            **config,  # type: ignore[arg-type]
        )
        self.fault: LinkFault | None = None
        self.is_stopped = self.was_slowed = False
        self._path: list[Vector] = []

    def __enter__(self) -> Self:
        """Connects, checks the robot and starts measuring.

        Raises:
            LinkFault: It cannot be reached, or is not ready; nothing was moved.
        """
        run = self._run
        if not run.protects_arms:
            run.say("the robot's own protection of its arms is OFF until the run is over")
        self.link = LinkProcess(run.access, self._config, run.preflight)
        try:
            self.link.wait_until_ready()
        except BaseException:
            self.link.close()
            raise
        self.clock = DiagramClock(self.link.clock.now, self.link.clock.sleep)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Hands the arm over and ends the link."""
        try:
            self._end(kind)
        except KeyboardInterrupt:
            self._run.say(f"interrupted: the {self._arm} arm is held, stiff, as it is")
            raise
        finally:
            self.link.close()

    def _end(self, kind: type[BaseException] | None) -> None:
        say = self._run.say
        if kind is None and not self._run.holds:
            self._retrace()
        fault = self.fault
        if fault is not None:
            self.fault = fault = self.link.last_fault() or fault
            say(f"{fault.word}: {fault}")
        holds = self._run.holds and kind is None and fault is None and not self.is_stopped
        if holds or kind is KeyboardInterrupt or (fault and fault.word not in HANDED_OVER):
            self.link.hold()
            say(f"the {self._arm} arm is held, stiff")
            return
        say(f"the {self._arm} arm is held, lowered and relaxed; Ctrl-C leaves it stiff")
        if not self.link.hand_over():
            left = self.link.last_fault()
            self.fault = self.fault or left
            say(f"the {self._arm} arm was left stiff" + (f": {left}" if left else ""))

    def _retrace(self) -> None:
        """Retraces the arm's path, unless there was a fault or a stop."""
        if self.fault is not None or self.is_stopped or not self._path:
            return
        arm = body_indices(arm_joints(self._arm))
        back = retraced_path(np.array(self._path)[:, arm])
        if len(back) < 3:  # It is there already.
            return
        postures = np.tile(list(self.joints.values()), (len(back), 1))
        postures[:, arm] = back
        motion = slow_motion(postures)
        say = self._run.say
        say(f"the {self._arm} arm goes back the way that it came, in {motion.times[-1]:.1f} s")
        self.go_along(motion)
        if self.fault is not None and self.fault.word == "dead_man":
            # The run was over: releasing the switch now is no fault.
            say(f"{self.fault.word}: {self.fault}")
            self.fault = None

    def go_along(self, motion: CalibrationMotion) -> None:
        """Drives the robot along a motion of its joints, without perception; see `advance`."""
        drive = CalibrationDrive(self.station(), motion)
        simulator = Simulator(drive)
        clock = simulator.get_context()
        self.advance(drive, lambda: clock.get_time() > motion.times[-1] + STANDS, simulator)

    @property
    def joints(self) -> dict[str, float]:
        """Current measured positions of all joints by name [rad]."""
        measured = map(float, self.link.state()["positions"])
        return dict(zip(BODY_JOINTS, measured, strict=True))

    @property
    def base_pose(self) -> Vector:
        """The base's current x, y [m] and yaw [rad] by odometry (3,)."""
        return np.array(self.link.state()["base_pose"])

    def station(self, calibration: RobotCalibration | None = None) -> HardwareStation:
        """Makes the station of the robot."""
        return HardwareStation(self.link, shared_control_model(), self.clock, calibration)

    def advance(
        self, diagram: Diagram, is_over: Callable[[], bool], simulator: Simulator | None = None
    ) -> Pacing:
        """Drives the robot by a diagram until it is over, stopped, or there is a fault.

        Args:
            diagram: With a station of this robot.
            is_over: Asked before each step.
            simulator: Of the diagram, if there is one.

        Returns:
            Timing statistics; `fault` and `is_stopped` tell how it ended.
        """
        self._wait_for_key()
        self._path = []

        def ends() -> bool:
            try:
                self.link.check()
            except LinkFault as fault:
                self.fault = fault
                return True
            state = self.link.state()
            self._path.append(np.array(state["positions"]))
            if not self.was_slowed and state["slowed"]:
                self.was_slowed = True
                self._run.say(f"arm_slowed: {LINK_FAULTS['arm_slowed']}")
            self.is_stopped = self.is_stopped or self._run.should_stop()
            return self.is_stopped or is_over()

        if simulator is None:
            simulator = Simulator(diagram)
        return run_paced(simulator, self.clock, ends)

    def _wait_for_key(self) -> None:
        """Waits until the dead man's switch is held."""
        if not self._config.dead_man:
            return
        key = "the space bar" if self._config.dead_man == KEYBOARD else "a button of the pad"
        self._run.say(f"hold {key}: the robot moves while it is held, and never without")
        while not self.link.state()["held"]:
            self.link.check()
            if self._run.should_stop():
                self.is_stopped = True
                return
            time.sleep(0.02)
