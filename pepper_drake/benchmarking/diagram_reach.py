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
from pepper_drake.diagrams.reach_result import ReachResult, save_result
from pepper_drake.diagrams.reach_simulation import ReachSimulation, RunOptions
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
from pepper_drake.planning.reach.reach_mode import ReachMode, last_attempt
from pepper_drake.results.folder import whole_results
from pepper_drake.results.reach_log import ReachLog
from pepper_drake.scenario import build_reaching
from pepper_drake.web.drake_page import offline_meshcat

Array = npt.NDArray[np.float64]

_REPLANS = ("check_reach", "replan", "plan_retreat", "plan_return")
"""The planner's calls that take effect after `PlanningLatency.plan`."""
_MOTION_THRESHOLD = 1e-6
"""Change of a joint command that counts as motion [rad]."""


@dataclass(frozen=True)
class DiagramReach:
    """A reach as in `apps/reach.py`.

    Attributes:
        coupling: The obstacle coupling or its name; the scene's if None.
        adapt: Whether the planner adapts the movement to perceived obstacles.
        collision_checked: Whether the arm starts only if the simulated reach is free of collisions,
            and stops before obstacles; see `ReachPlannerParams.collision_checked`.
        planner: Name of the planner.
        options: Equivalent options of `reach.py`; None if there are none.
    """

    coupling: str | Coupling | None = None
    adapt: bool = False
    collision_checked: bool = True
    planner: str = DEFAULT_PLANNER
    options: tuple[str, ...] | None = ()

    def __call__(self, case: Case) -> MethodResult:
        """Runs the reach, without display."""
        return _run(self._build(case), RunOptions(progress=False))[1]

    def replay(self, case: Case, folder: Path) -> MethodResult:
        """Runs the reach again and writes a folder like `reach.py`, with `recording.html`."""
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
    """Returns the benchmark's result of a reach, from its report and log.

    Args:
        result: Result of the reach.
        primitive: Primitive of the demonstration, for demonstration_distance.
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
    # The delay is that at the last base pose.
    last = last_attempt(log.mode)
    measured.first_motion_seconds = first_motion(log, last, arm, report.planning_delay)
    if measured.outcome == "reached":
        first = int(np.argmax(moving))
        arrival = arrival_row(log.mode)
        step = float(log.time_s[1] - log.time_s[0])
        measured.duration = float(log.time_s[arrival] - log.time_s[first])
        held = round(CONTROL_PERIOD / step)
        hand = interpolate_held(commanded_hand(log.joint_command_rad[first:], arm), held)
        measured.path_length = path_length(hand)
        measured.jerk = rms_jerk(hand, step)
        measured.demonstration_distance = demonstration_distance(
            primitive, hand, float(log.tau_s[-1]), step
        )
    return measured


def outcome_of(report_outcome: str, clearance: float, started: bool) -> str:
    """Returns one of `OUTCOMES`; a contact takes precedence.

    Args:
        report_outcome: Outcome in the reach's report.
        clearance: Smallest true distance to an obstacle over the whole run [m].
        started: Whether the arm was allowed to start.
    """
    if clearance <= 0.0:
        return "touched"
    if report_outcome == "reached":
        return "reached"
    return "failed" if started else "refused"


def arrival_row(mode: npt.NDArray[np.int64]) -> int:
    """Returns the row in which the hand arrived last; a goal may move on after it has arrived.

    Args:
        mode: The `ReachMode` of each row (N,), of a reach that reached.
    """
    holds = mode == ReachMode.HOLDING
    return int(np.flatnonzero(holds[1:] & ~holds[:-1])[-1]) + 1


def first_motion(log: ReachLog, moving: npt.NDArray[np.bool_], arm: str, delay: float) -> float:
    """Returns the time from the robot's settling to the arm's first motion [s].

    It is the simulated time that the arm waits for its plan, plus the time until a joint of the arm
    is commanded to move. NaN if none is.
    """
    first = int(np.argmax(moving))
    commands = log.joint_command_rad[:, body_indices(arm_joints(arm))]
    moves = np.abs(commands[first:] - commands[first]).max(axis=1) > _MOTION_THRESHOLD
    if not moves.any():
        return float("nan")
    return delay + float(log.time_s[first + int(np.argmax(moves))] - log.time_s[first])


def interpolate_held(positions: Array, held: int) -> Array:
    """Returns a smooth path (M, 3) through positions (N, 3), each held for `held` samples.

    Differences of the held positions would be steps, unlike those of the path. The path starts at
    the first change of the positions and has their sampling rate.
    """
    changes = np.flatnonzero(np.any(np.diff(positions, axis=0) != 0.0, axis=1))
    given = positions[changes[0] if len(changes) else 0 :: held]
    if len(given) < 4:
        return given
    knots = np.arange(len(given))
    fine = np.linspace(0.0, knots[-1], held * knots[-1] + 1)
    return np.asarray(CubicSpline(knots, given)(fine))


def commanded_hand(joint_commands: Array, arm: str) -> Array:
    """Returns the hand's positions (N, 3) in T [m] for commands (N, 15) of all joints [rad]."""
    kinematics = arm_kinematics(shared_control_model(), arm)
    joints = joint_commands[:, body_indices(arm_joints(arm))]
    return np.array([kinematics.hand_pose(q).translation() for q in joints])
