"""One reach of a robot: checked before, paced by the clock, and handed over at the end."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from importlib.metadata import version
from pathlib import Path

import numpy as np
import numpy.typing as npt
from pydrake.systems.analysis import Simulator

from pepper_drake.diagrams.reaching import Reaching, ReachingConfig
from pepper_drake.hardware.link import LinkConfig
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.link_process import LinkProcess, given_fault
from pepper_drake.hardware.paced_run import LATE_PERIODS, Pacing, run_paced
from pepper_drake.hardware.preflight import PreflightOptions
from pepper_drake.hardware.station import HardwareStation
from pepper_drake.hardware.transport import RobotAccess
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.coupling import Coupling
from pepper_drake.models.control_model import BODY_JOINTS, CONTROL_PERIOD, shared_control_model
from pepper_drake.models.scene import RobotStart, Scene
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.results.reach_report import ReachReport

Vector = npt.NDArray[np.float64]

LONGEST = 120.0
"""No reach takes longer [s]."""
_LOG_PERIOD = 0.02
_LOGGED = (
    "joint_position",
    "joint_command",
    "base_pose",
    "hand_position",
    "desired_position",
    "goal_position",
    "mode",
    "seen_clearance",
)


@dataclass
class HardwareReport(ReachReport):
    """Contents of `report.json` for a robot: what is known without the truth, and the link."""

    address: str = ""
    """Address of the robot."""
    believed_position_error: float | None = None
    """Distance between the hand and the goal, as the robot sees both, at the end [m]."""
    skipped_steps: int = 0
    """Steps of 20 ms that this computer left out."""
    worst_lateness: float = 0.0
    """Longest time by which a step was late [s]."""
    link_late: int = 0
    """Cycles of the link that were left out."""
    round_trip: float = 0.0
    """Time from a call to its answer at the end [s]."""
    clock_bound: float = 0.0
    """Largest error of the clocks' offset [s]."""
    fault: str = ""
    """Word of what went wrong with robot or link."""


@dataclass(frozen=True)
class HardwareRun:
    """Options of a reach with a robot.

    Attributes:
        access: Way to the robot.
        preflight: What is done before.
        should_stop: Asked before each step; when it says so the arm is handed over.
        say: Takes a line for people.
        holds: Whether the arm stays where it is at the end, stiff, and is not handed over.
        clock_rate: Rate of the robot's clock; see `LinkConfig`.
    """

    access: RobotAccess
    preflight: PreflightOptions = field(default_factory=PreflightOptions)
    should_stop: Callable[[], bool] = lambda: False
    say: Callable[[str], None] = lambda _: None
    holds: bool = False
    clock_rate: float = 1.0


@dataclass(frozen=True, eq=False)
class HardwareResult:
    """Report and log of a robot's reach: rows of each signal by name, and their times."""

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
    """Reaches with a robot, whatever its posture is at the start.

    Args:
        scene: Tells which arm reaches for what object; nothing else of it is known to the robot.
        primitive: The movement.
        coupling: How obstacles bend it.
        config: How the reach is built.
        run: How the robot is led.

    Raises:
        LinkFault: The robot cannot be reached, or is not ready; nothing was moved.
    """
    with LinkProcess(
        run.access, LinkConfig(scene.arm, clock_rate=run.clock_rate), run.preflight
    ) as link:
        link.wait_until_ready()
        scene = _where_it_stands(scene, link)
        start = link.clock.now()
        config = replace(config, log_period=_LOG_PERIOD)
        station = HardwareStation(link, shared_control_model(), start, config.station.calibration)
        reaching = Reaching(scene, primitive, coupling, config, station)
        simulator = Simulator(reaching)
        # Building took a moment; the diagram's time begins now.
        simulator.get_mutable_context().SetTime(
            CONTROL_PERIOD * int((link.clock.now() - start) / CONTROL_PERIOD)
        )
        simulator.Initialize()
        progress = _Progress(reaching, simulator, link, run)
        pacing = run_paced(
            simulator, start, progress.is_over, wall=link.clock.now, sleep=link.clock.sleep
        )
        report = progress.report(pacing)
        run.say(report.summary())
        if not run.holds and not report.fault:
            run.say("the arm is held, lowered and relaxed")
            link.hand_over()
            state = link.state()
            if str(state["fault"]):
                report.fault = str(state["fault"])
                report.message = str(given_fault(state))
        return HardwareResult(report, progress.log())


def _where_it_stands(scene: Scene, link: LinkProcess) -> Scene:
    """Returns the scene with the robot as it was measured."""
    state = link.state()
    x, y, yaw = map(float, state["base_pose"])
    joints = dict(zip(BODY_JOINTS, map(float, state["positions"]), strict=True))
    return replace(scene, robot=RobotStart(x, y, yaw, joints=joints))


class _Progress:
    """State of a run."""

    def __init__(
        self, reaching: Reaching, simulator: Simulator, link: LinkProcess, run: HardwareRun
    ) -> None:
        self._reaching, self._simulator, self._link, self._run = reaching, simulator, link, run
        self._fault: LinkFault | None = None
        self._mode = ReachMode.LOOKING
        self._begin = simulator.get_context().get_time()
        self._stopped = False

    def is_over(self) -> bool:
        """Looks at the link and at what the robot is doing."""
        try:
            self._link.check()
        except LinkFault as fault:
            self._fault = fault
            return True
        supervisor = self._reaching.supervisor
        context = supervisor.GetMyContextFromRoot(self._simulator.get_context())
        mode = supervisor.progress(context).mode
        if mode != self._mode:
            self._mode = mode
            self._run.say(f"{self._seconds():6.2f} s  {mode.name.lower()}")
        self._stopped = self._run.should_stop()
        is_done = mode in (ReachMode.DONE, ReachMode.FAILED)
        return is_done or self._stopped or self._seconds() > LONGEST

    def _seconds(self) -> float:
        return self._simulator.get_context().get_time() - self._begin

    def log(self) -> dict[str, Vector]:
        """Returns the rows (N, n) of each signal, and `time` (N,)."""
        root, logs = self._simulator.get_context(), self._reaching.logs
        rows = {name: np.array(logs[name].FindLog(root).data()).T for name in _LOGGED}
        return {"time": np.array(logs["mode"].FindLog(root).sample_times()), **rows}

    def report(self, pacing: Pacing) -> HardwareReport:
        """Makes the report."""
        reaching, root, state = self._reaching, self._simulator.get_context(), self._link.state()
        supervisor = reaching.supervisor
        progress = supervisor.progress(supervisor.GetMyContextFromRoot(root))
        report = HardwareReport(
            scene=reaching.scene.name,
            arm=reaching.scene.arm,
            coupling=reaching.scene.coupling,
            seed=reaching.config.station.seed,
            simulated_seconds=self._seconds(),
            wall_seconds=self._seconds(),
            realtime_factor=1.0,
            versions={name: version(name) for name in ("pepper-drake", "drake", "numpy")},
            address=self._run.access.address,
            skipped_steps=pacing.skipped,
            worst_lateness=pacing.worst,
            link_late=int(state["late"]),
            round_trip=float(state["round_trip"]),
            clock_bound=float(state["clock_bound"]),
        )
        log = self.log()
        last = log["hand_position"][-1] - log["goal_position"][-1]
        if np.isfinite(last).all() and self._mode in (ReachMode.DONE, ReachMode.HOLDING):
            report.believed_position_error = float(np.linalg.norm(last))
        if self._fault is not None:
            report.fault = report.reason = self._fault.word
            report.message = str(self._fault)
        elif self._mode == ReachMode.DONE:
            # The robot's own belief: nobody measured where the object truly was.
            report.outcome = "reached"
        elif self._mode == ReachMode.FAILED:
            report.reason, report.message = progress.reason, progress.message
        elif self._stopped:
            report.reason = "interrupted"
            report.message = f"the run was ended at {self._seconds():.1f} s"
        else:
            report.reason = "timeout"
            report.message = f"the reach was not over after {LONGEST:g} s"
        if pacing.worst > LATE_PERIODS * CONTROL_PERIOD:
            self._run.say(
                f"this computer was late by up to {pacing.worst:.2f} s; the arm held meanwhile"
            )
        return report
