"""Likely cause behind the symptom of a failed reach."""

from dataclasses import replace

import numpy as np

from pepper_drake.models.control_model import body_indices
from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.perception.mapping.depth_validity import FAULT_SENTENCES, DepthFault
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_parameters import ReachPlannerParams
from pepper_drake.planning.reach.reach_plan import PlanStatus
from pepper_drake.planning.reach.reach_state import ReachState
from pepper_drake.planning.reach.steadiness import SteadinessParams
from pepper_drake.planning.safety.command_check import StopReason

_GOAL_UNSEEN = {"goal_not_seen", "goal_lost"}
_SEEN = {*PlanStatus, *_GOAL_UNSEEN, StopReason.BODY_TOO_CLOSE.name.lower()}
"""Reasons that follow from what is seen."""


def with_cause(state: ReachState, params: SteadinessParams) -> ReachState:
    """Returns the state before the arm starts, failed for what is wrong with what is seen, if so.

    Until then an unsteady signal ends nothing: it matters where what was seen leads nowhere.

    Args:
        state: State of the supervision.
        params: Thresholds of steadiness.
    """
    if state.mode != ReachMode.FAILED or state.reason not in _SEEN:
        return state
    cause = state.steadiness.cause(params)
    if cause is None and state.reason in {PlanStatus.NOT_SEEN, *_GOAL_UNSEEN}:
        depth = state.reason not in _GOAL_UNSEEN
        cause = state.steadiness.late_images(depth, params)
    if cause is None:
        return state
    return replace(state, reason=cause[0], message=f"{cause[1]}; {state.message}")


def likely_cause(
    state: ReachState, observation: Observation, params: ReachPlannerParams, symptom: str
) -> tuple[str, str] | None:
    """Returns reason and sentence of the cause that explains a symptom; None if none is known.

    Args:
        state: State of the supervision.
        observation: The present one.
        params: Thresholds of joint error, goal and robot displacement.
        symptom: The failure as a sentence.
    """
    planned = state.planned_with
    joint_error = observation.joint_error
    worst = int(np.argmax(np.abs(joint_error)))
    if abs(joint_error[worst]) > params.following.contact:
        degrees = abs(np.degrees(joint_error[worst]))
        name = JOINT_GROUPS["right_arm"][worst][1:]
        return "contact", (
            f"the arm is held or touches something: its {name} is {degrees:.0f} degrees off "
            f"its command; {symptom}"
        )
    if state.blind > params.cause.blind:
        if state.blind_fault in (DepthFault.NONE, DepthFault.MISSING, DepthFault.LATE):
            return "cloud_missing", (
                f"the depth camera's images came so late or so seldom that the robot waited for "
                f"them for {state.blind:.1f} s"
            )
        sentence = FAULT_SENTENCES[state.blind_fault]
        return "cloud_missing", f"{sentence}: the robot waited for others for {state.blind:.1f} s"
    if planned is None:
        return None
    moved = float(np.linalg.norm(observation.p_WO - planned.p_WO))
    if moved > params.tolerance.jumped:
        return "goal_moved", (
            f"the goal object is seen {1000 * moved:.0f} mm from where it was at the last plan; "
            f"{symptom}"
        )
    torso = body_indices(JOINT_GROUPS["body"])
    tilt = np.abs(observation.joint_position - planned.joint_position)[torso].max()
    drift = np.linalg.norm((observation.base_pose - planned.base_pose)[:2])
    if tilt > params.cause.torso_moved or drift > params.cause.base_moved:
        return "robot_moved", (
            f"the robot moved during the reach, the base by {1000 * drift:.0f} mm and the "
            f"torso by {np.degrees(tilt):.0f} degrees; {symptom}"
        )
    return None
