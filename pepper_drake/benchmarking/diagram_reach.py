"""One reach in the full diagram, with dynamics, cameras and noise, measured for the benchmark."""

import sys
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.interpolate import CubicSpline

from pepper_drake.benchmarking.case import Case
from pepper_drake.benchmarking.method_result import MethodResult
from pepper_drake.benchmarking.metrics import demonstration_distance, path_length, rms_jerk
from pepper_drake.diagrams.factory import make_primitive
from pepper_drake.diagrams.reach_simulation import (
    ReachResult,
    ReachSimulation,
    RunOptions,
    save_result,
)
from pepper_drake.diagrams.reaching import Reaching
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.dmp.obstacle_coupling import Coupling
from pepper_drake.models.control_model import (
    CONTROL_PERIOD,
    arm_joints,
    body_indices,
    shared_control_model,
)
from pepper_drake.planning.collision.arm_kinematics import arm_kinematics
from pepper_drake.planning.reach.planner_registry import DEFAULT_PLANNER
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.results.folder import whole_results
from pepper_drake.results.reach_log import ReachLog
from pepper_drake.scenario import build_reaching
from pepper_drake.web.drake_page import offline_meshcat

Array = npt.NDArray[np.float64]

_REPLANS = ("check_reach", "replan", "plan_retreat")
"""The planner's calls whose effect comes after `PlanningLatency.plan`."""
_STARTED = 1e-6
"""A joint command that differs by this from the one at rest is motion [rad]."""


@dataclass(frozen=True)
class DiagramReach:
    """A reach as `apps/reach.py` does it.

    Attributes:
        coupling: The obstacle coupling, by name or as it is; left out, it is the scene's.
        adapt: Whether the planner adapts the movement to what was seen.
        collision_checked: Whether the arm starts only when the reach, played through, is clear, and
            stops before what it sees; see `ReachPlannerParams.collision_checked`.
        planner: Name of the planner; ours if left out.
        options: The options of `reach.py` that give the same; None if it cannot.
    """

    coupling: str | Coupling | None = None
    adapt: bool = False
    collision_checked: bool = True
    planner: str = DEFAULT_PLANNER
    options: tuple[str, ...] | None = ()

    def __call__(self, case: Case) -> MethodResult:
        """Runs the reach, unseen."""
        return _run(self._build(case), RunOptions(progress=False))[1]

    def replay(self, case: Case, folder: Path) -> MethodResult:
        """Runs the reach again and leaves `reach.py`'s folder, `recording.html` with it."""
        with offline_meshcat() as meshcat:
            options = RunOptions(meshcat=meshcat, record=True, progress=sys.stderr.isatty())
            result, measured = _run(self._build(case), options)
        with whole_results(folder, ()) as inside:
            save_result(result, inside)
        return measured

    def _build(self, case: Case) -> Reaching:
        scenario = case.scenario()
        planner = replace(
            scenario.planner, adapt=self.adapt, collision_checked=self.collision_checked
        )
        scenario = replace(scenario, planner=planner, planner_class=self.planner)
        if isinstance(self.coupling, str):
            scenario.scene.coupling = self.coupling
        own = None if isinstance(self.coupling, str) else self.coupling
        return build_reaching(scenario, coupling=own)


def _run(reaching: Reaching, options: RunOptions) -> tuple[ReachResult, MethodResult]:
    arm = reaching.scene.arm
    result = ReachSimulation(reaching, options).run()
    measured = measure(result, make_primitive(None, arm), arm)
    measured.planning_latency = reaching.config.timing.latency.plan
    times = [one.seconds for one in reaching.timed_planner.log if one.name in _REPLANS]
    if times:
        measured.replan_seconds_99 = float(np.percentile(times, 99))
    return result, measured


def measure(result: ReachResult, primitive: MovementPrimitive, arm: str) -> MethodResult:
    """Takes the benchmark's numbers from a reach's report and log.

    Args:
        result: Of the reach.
        primitive: Learned from the demonstration, for demonstration_distance.
        arm: "left" or "right".
    """
    report, log = result.report, result.log
    moving = np.isin(log.mode, (ReachMode.REACHING, ReachMode.HOLDING, ReachMode.DONE))
    measured = MethodResult(
        outcome=outcome_of(report.outcome, float(log.clearance_m.min()), bool(moving.any())),
        reason=report.reason,
        message=report.message,
        planning_seconds=report.planning_seconds,
        touch_speed=report.touch_speed,
        clearance=report.minimum_clearance,
        closest_pair=report.closest_pair,
        position_error=report.final_position_error,
        orientation_error=report.final_orientation_error,
        goal_estimate_error=report.goal_estimate_error,
        realtime_factor=report.realtime_factor,
    )
    if not moving.any() or report.planning_delay is None:
        return measured
    measured.first_motion_seconds = first_motion(log, moving, arm, report.planning_delay)
    if measured.outcome == "reached":
        first = int(np.argmax(moving))
        rested = int(np.argmax(log.mode == ReachMode.HOLDING))
        step = float(log.time_s[1] - log.time_s[0])
        measured.duration = float(log.time_s[rested] - log.time_s[first])
        held = round(CONTROL_PERIOD / step)
        hand = interpolate_held(commanded_hand(log.joint_command_rad[first:], arm), held)
        measured.path_length = path_length(hand)
        measured.jerk = rms_jerk(hand, step)
        measured.demonstration_distance = demonstration_distance(
            primitive, hand, float(log.tau_s[-1]), step
        )
    return measured


def outcome_of(report_outcome: str, clearance: float, started: bool) -> str:
    """One of `OUTCOMES`: touching counts before all else.

    Args:
        report_outcome: "reached" or "failed", as the reach's report has it.
        clearance: Least true distance to an obstacle over the whole run [m].
        started: Whether the arm was allowed to start.
    """
    if clearance <= 0.0:
        return "touched"
    if report_outcome == "reached":
        return "reached"
    return "failed" if started else "refused"


def first_motion(log: ReachLog, moving: npt.NDArray[np.bool_], arm: str, delay: float) -> float:
    """Time from when the robot has settled to its first command [s].

    The simulated time for which the arm waits for its plan, and then the time until a joint of the
    arm is commanded to move.
    """
    first = int(np.argmax(moving))
    commands = log.joint_command_rad[:, body_indices(arm_joints(arm))]
    away = np.abs(commands[first:] - commands[first]).max(axis=1) > _STARTED
    if not away.any():
        return float("nan")
    return delay + float(log.time_s[first + int(np.argmax(away))] - log.time_s[first])


def interpolate_held(positions: Array, held: int) -> Array:
    """The smooth path (M, 3) through positions (N, 3) that were logged faster than they were given.

    Each is held for so many samples; what a path is like, its steps do not tell. It starts when
    the positions begin to change, and has as many samples a second as they.
    """
    changes = np.flatnonzero(np.any(np.diff(positions, axis=0) != 0.0, axis=1))
    given = positions[changes[0] if len(changes) else 0 :: held]
    if len(given) < 4:
        return given
    knots = np.arange(len(given))
    fine = np.linspace(0.0, knots[-1], held * knots[-1] + 1)
    return np.asarray(CubicSpline(knots, given)(fine))


def commanded_hand(joint_commands: Array, arm: str) -> Array:
    """The hand's positions (N, 3) in T [m] for commands (N, 15) of all joints [rad]."""
    kinematics = arm_kinematics(shared_control_model(), arm)
    joints = joint_commands[:, body_indices(arm_joints(arm))]
    return np.array([kinematics.hand_pose(q).translation() for q in joints])
