"""One reach of a robot: checked before, paced by the clock, and handed over at the end."""

from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.reaching import Reaching
from pepper_drake.diagrams.reaching_config import ReachingConfig
from pepper_drake.diagrams.verdict import RunEnd, judge_by_robot
from pepper_drake.hardware.link_fault import LINK_FAULTS
from pepper_drake.hardware.paced_run import Pacing
from pepper_drake.hardware.robot_run import HardwareRun, RobotRun
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.obstacle_coupling import Coupling
from pepper_drake.models.control_model import CONTROL_PERIOD
from pepper_drake.models.scene import RobotStart, Scene
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.results.reach_report import ReachReport

Vector = npt.NDArray[np.float64]

_LOG_PERIOD = 0.02
_LOGGED = (
    "joint_position",
    "joint_command",
    "base_pose",
    "hand_opening",
    "hand_position",
    "desired_position",
    "goal_position",
    "mode",
    "seen_clearance",
)


@dataclass
class HardwareReport(ReachReport):
    """Contents of `report.json` for a robot: without ground truth, with the link's statistics."""

    address: str = ""
    """Address of the robot."""
    believed_position_error: float | None = None
    """Final distance of the hand from the goal, both as estimated by the robot [m]."""
    skipped_steps: int = 0
    """Periods of 20 ms in which the arm was held because this computer planned or was too slow."""
    worst_lateness: float = 0.0
    """Largest lateness of a step [s]."""
    link_late: int = 0
    """Skipped cycles of the link."""
    round_trip: float = 0.0
    """Final round-trip time of a call [s]."""
    clock_bound: float = 0.0
    """Error bound of the clock offset [s]."""
    fault: str = ""
    """Word of the fault of robot or link."""
    warnings: list[str] = field(default_factory=list)
    """Words of faults that did not end the run."""
    # Not measured, which is not zero.
    contacts: int | None = None
    contact_force: float | None = None
    goal_force: float | None = None
    arm_speed: float | None = None
    command_acceleration: float | None = None

    def summary(self) -> str:
        """A few lines for the terminal, from the robot's own estimates."""
        lines = [f"{self.outcome}" + (f": {self.message}" if self.message else "")]
        lines.extend(self.movement.lines(coupled=self.coupling != "none"))
        if self.believed_position_error is not None:
            error = 1000 * self.believed_position_error
            lines.append(f"  hand to goal      {error:6.1f} mm   (as the robot sees both)")
        held = self.skipped_steps * CONTROL_PERIOD
        lines.append(
            f"  took {self.wall_seconds:.1f} s; for {held:.1f} s of it the arm was held while this "
            "computer planned or was too slow"
        )
        lines.extend(f"  {word}: {LINK_FAULTS[word]}" for word in self.warnings)
        return "\n".join(lines)


@dataclass(frozen=True, eq=False)
class HardwareResult:
    """Report and log of a robot's reach: rows of each signal by name, with their times."""

    report: HardwareReport
    log: dict[str, Vector]

    def save(self, folder: Path) -> None:
        """Writes `report.json` and `log.npz`."""
        folder.mkdir(parents=True, exist_ok=True)
        self.report.save(folder / "report.json")
        np.savez_compressed(folder / "log.npz", **self.log)  # type: ignore[arg-type]


def reach_with_robot(
    scene: Scene,
    primitive: MovementPrimitive,
    coupling: Coupling | None,
    config: ReachingConfig,
    run: HardwareRun,
) -> HardwareResult:
    """Reaches with a robot from any initial posture.

    Args:
        scene: Gives the arm and the goal object; the robot knows nothing else of it.
        primitive: The movement.
        coupling: Of obstacles with the movement.
        config: Of the reach.
        run: How the robot is driven.

    Raises:
        LinkFault: The robot cannot be reached, or is not ready; nothing was moved.
    """
    with RobotRun(run, scene.arm) as robot:
        scene = _with_measured_robot(scene, robot)
        config = replace(config, log_period=_LOG_PERIOD)
        station = robot.station(config.station.calibration)
        reaching = Reaching(scene, primitive, coupling, config, station)
        simulator = Simulator(reaching)
        progress = _Progress(reaching, simulator, run)
        pacing = robot.advance(reaching, progress.is_over, simulator)
        report = progress.report(robot, pacing)
        run.say(report.summary())
    if robot.fault is not None:
        report.fault, report.message = robot.fault.word, str(robot.fault)
        if report.outcome != "reached":
            report.reason = robot.fault.word
    return HardwareResult(report, progress.log())


def _with_measured_robot(scene: Scene, robot: RobotRun) -> Scene:
    """Returns the scene with the robot's measured posture."""
    x, y, yaw = map(float, robot.base_pose)
    return replace(scene, robot=RobotStart(x, y, yaw, joints=robot.joints))


class _Progress:
    """State of a run."""

    def __init__(self, reaching: Reaching, simulator: Simulator, run: HardwareRun) -> None:
        self._reaching, self._simulator, self._run = reaching, simulator, run
        self._mode = ReachMode.LOOKING

    def is_over(self) -> bool:
        """Reports changes of the mode, and returns whether the reach is over."""
        supervisor = self._reaching.supervisor
        context = supervisor.GetMyContextFromRoot(self._simulator.get_context())
        mode = supervisor.progress(context).mode
        if mode != self._mode:
            self._mode = mode
            self._run.say(f"{self._seconds():6.2f} s  {mode.name.lower()}")
        is_done = mode == ReachMode.DONE and self._is_finished()
        longest = self._reaching.config.timing.longest
        return is_done or mode == ReachMode.FAILED or self._seconds() > longest

    def _is_finished(self) -> bool:
        """Returns whether all tasks are done."""
        sequencer, root = self._reaching.sequencer, self._simulator.get_context()
        return sequencer is None or (
            sequencer.progress(sequencer.GetMyContextFromRoot(root)).finished
        )

    def _seconds(self) -> float:
        return self._simulator.get_context().get_time()

    def log(self) -> dict[str, Vector]:
        """Returns the rows (N, n) of each signal, and `time` (N,)."""
        root, logs = self._simulator.get_context(), self._reaching.logs
        rows = {name: np.array(logs[name].FindLog(root).data()).T for name in _LOGGED}
        return {"time": np.array(logs["mode"].FindLog(root).sample_times()), **rows}

    def report(self, robot: RobotRun, pacing: Pacing) -> HardwareReport:
        """Makes the report."""
        reaching, root, state = self._reaching, self._simulator.get_context(), robot.link.state()
        supervisor = reaching.supervisor
        progress = supervisor.progress(supervisor.GetMyContextFromRoot(root))
        wall = self._seconds() + pacing.skipped * CONTROL_PERIOD
        report = HardwareReport(
            scene=reaching.scene.name,
            arm=reaching.scene.arm,
            coupling=reaching.scene.coupling,
            seed=reaching.config.station.seed,
            simulated_seconds=self._seconds(),
            wall_seconds=wall,
            realtime_factor=self._seconds() / wall,
            versions={name: version(name) for name in ("pepper-drake", "drake", "numpy")},
            address=self._run.access.address,
            skipped_steps=pacing.skipped,
            worst_lateness=pacing.worst,
            link_late=int(state["late"]),
            round_trip=float(state["round_trip"]),
            clock_bound=float(state["clock_bound"]),
            warnings=["arm_slowed"] if robot.was_slowed else [],
        )
        log = self.log()
        last = log["hand_position"][-1] - log["goal_position"][-1]
        if np.isfinite(last).all() and self._mode in (ReachMode.DONE, ReachMode.HOLDING):
            report.believed_position_error = float(np.linalg.norm(last))
        if robot.fault is not None:
            report.reason, report.message = robot.fault.word, str(robot.fault)
            return report
        # By the robot's own estimate: the object's true position was not measured.
        is_done = self._mode != ReachMode.DONE or self._is_finished()
        end = RunEnd(
            self._mode if is_done else ReachMode.HOLDING,
            progress.reason,
            progress.message,
            is_over=not robot.is_stopped,
        )
        judge_by_robot(report, end, reaching.config.timing.longest)
        return report
