"""Verdict on a simulated reach: outcome, reason and sentence."""

from dataclasses import dataclass

import numpy as np

from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_parameters import GoalTolerances
from pepper_drake.planning.reach.reach_state_machine import UNCONFIRMED
from pepper_drake.results.reach_report import ReachReport


@dataclass(frozen=True)
class RunEnd:
    """End of a run.

    Attributes:
        mode: The supervisor's last mode.
        reason: Its reason for that mode, "" for none.
        message: The same as a sentence.
        fault: Drake's error in one sentence; empty if there was none.
        is_over: False if the run was interrupted.
    """

    mode: ReachMode
    reason: str = ""
    message: str = ""
    fault: str = ""
    is_over: bool = True


def judge_by_robot(report: ReachReport, end: RunEnd, longest: float) -> None:
    """Fills in outcome and reason as the robot itself reports them.

    Args:
        report: The run, which is changed.
        end: How it ended.
        longest: Timeout of the run [s].
    """
    if end.fault:
        report.reason, report.message = "simulation_failed", end.fault
    elif end.mode == ReachMode.FAILED:
        report.reason, report.message = end.reason, end.message
        if len(report.tasks) > 1:
            report.message = f"{report.tasks[-1].name}: {end.message}"
    elif end.mode != ReachMode.DONE and not end.is_over:
        report.reason = "interrupted"
        report.message = f"the run was ended at {report.simulated_seconds:.1f} s"
    elif end.mode != ReachMode.DONE:
        report.reason = "timeout"
        report.message = f"the reach was not over after {longest:g} s"
    elif end.reason == UNCONFIRMED:
        report.outcome, report.reason, report.message = UNCONFIRMED, end.reason, end.message
    else:
        report.outcome = "reached"


def judge(report: ReachReport, end: RunEnd, limits: GoalTolerances, longest: float) -> None:
    """Fills in outcome and reason, first as the robot reports them, then by ground truth.

    Args:
        report: The measured run, which is changed.
        end: How it ended.
        limits: Tolerances of the hand's position and of the force on the goal object.
        longest: Timeout of the run [s].
    """
    judge_by_robot(report, end, longest)
    touched = f"a link touched an obstacle ({report.closest_pair})"
    force, pushed = report.goal_force or 0.0, ""
    if force > limits.force:
        pushed = (
            f"the goal object was pushed with {force:.0f} N, more than "
            f"{limits.force:g} N (planner.tolerance.force)"
        )
    if end.mode == ReachMode.DONE and not end.fault:
        wrong = _untrue(report, end, limits, touched, pushed)
        if wrong is not None:
            report.outcome, (report.reason, report.message) = "failed", wrong
    for happened, reason, sentence in (
        (bool(report.contacts), "touched", touched),
        (bool(pushed), "goal_pushed", pushed),
    ):
        if happened and report.reason != reason:
            report.message = f"{report.message}; {sentence}" if report.message else sentence


def _untrue(
    report: ReachReport, end: RunEnd, limits: GoalTolerances, touched: str, pushed: str
) -> tuple[str, str] | None:
    """Returns reason and sentence of what is wrong where the robot takes itself to be done."""
    turned = float(report.final_axis_error or 0.0)
    may_turn = np.inf if report.axis_tolerance is None else report.axis_tolerance
    if report.contacts:
        return "touched", touched
    if pushed:
        return "goal_pushed", pushed
    if report.final_position_error is None or any(
        task.final_position_error > limits.accept for task in report.tasks
    ):
        if end.reason == UNCONFIRMED:
            return "not_at_goal", f"{end.message}, and it is not there"
        return "not_at_goal", "the hand is farther from the true goal than the robot believes"
    if turned > may_turn:
        return "turned_away", (
            f"the hand's axis is {np.degrees(turned):.0f} degrees off, more than the scene allows "
            "(goal.pre_grasp.tolerance)"
        )
    return None
