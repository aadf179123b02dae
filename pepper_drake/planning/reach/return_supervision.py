"""Supervision of an arm that returns to its first posture, for the robot to drive elsewhere."""

from dataclasses import replace

import numpy as np

from pepper_drake.planning.reach.drive_supervision import DriveSupervision
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_parameters import ReachTiming
from pepper_drake.planning.reach.reach_plan import Planner, PlanStatus
from pepper_drake.planning.reach.reach_state import Effect, Pending, ReachState
from pepper_drake.planning.reach.replanner import ReachReplanner


class ReturnSupervision(DriveSupervision):
    """One step of a reach that is given up from where the robot stands; see `DriveSupervision`."""

    def __init__(self, observation: Observation, planner: Planner, timing: ReachTiming) -> None:
        super().__init__(observation, planner, timing)
        self._replanner = ReachReplanner(planner, timing)

    def _may_drive(self, state: ReachState) -> bool:
        return self._timing.drives and state.may_drive

    def give_up(self, state: ReachState, failed: ReachState) -> ReachState:
        """Returns the failed state, or that of a robot that will drive elsewhere.

        Args:
            state: The present state.
            failed: That of a robot that does not drive elsewhere.
        """
        may_drive = self._may_drive(state) and state.places < self._timing.max_base_placements
        helps = failed.reason in (PlanStatus.NO_CLEAR_PATH.value, "goal_moved")
        knows_path = state.plan is not None and state.plan.joint_path is not None
        if not (may_drive and helps and knows_path and state.started_with is not None):
            return failed
        given_up = failed.reason, failed.message
        return replace(state, given_up=given_up, given_up_at=self._time)

    def go_back(
        self, state: ReachState, given_up: tuple[str, str], last_cloud: float
    ) -> ReachState:
        """Brings the arm back to its first posture; fails if it does not get there in time.

        Args:
            state: The present state.
            given_up: Reason and sentence of the failure.
            last_cloud: Capture time of the cloud of the last step [s].
        """
        observation, timing = self._observation, self._timing
        if self._time - state.given_up_at > timing.return_timeout:
            return state.fail(self._time, *given_up)
        if state.performed_origin == Origin.RETURN:
            return self._returned(state)
        is_new = observation.cloud_time != last_cloud
        # What moves is too uncertain to pass; and a detour that was found is better.
        waits = len(observation.predicted_cloud) > 0 or any(map(_leads_on, state.pending))
        if waits or not is_new or observation.cloud_age > timing.cloud_timeout:
            return state
        back, due = self._replanner.plan_return(state, observation)
        looks = self._time - state.given_up_at <= timing.unseen_timeout
        if back.status == PlanStatus.NOT_SEEN and looks:
            x, y, z = back.look_at
            return replace(state, look_at=(x, y, z))
        if back.status != PlanStatus.CLEAR:
            if state.suspended_plan is None or state.waited > timing.blocked_timeout:
                return state.fail(self._time, *given_up)
            waited = state.waited + self._time - state.given_up_at
            return replace(state, given_up=None, waited=waited)  # It may wait on.
        # A retreat that has not begun is not needed; a brake is.
        brakes = tuple(one for one in state.pending if one.effect == Effect.BRAKE)
        reach = state.suspended_plan or state.plan
        pending = Pending(due, Effect.MOVEMENT, back, observation, reach)
        return replace(state, pending=(*brakes, pending))

    def _returned(self, state: ReachState) -> ReachState:
        """Looks for another base placement once the arm is back at rest in its first posture."""
        observation, following = self._observation, self._planner.params.following
        behind = observation.following_error
        if behind > following.stop:
            message = f"the hand fell {1000 * behind:.0f} mm behind its movement"
            return self._fail(state, PlanStatus.CANNOT_FOLLOW.value, message)
        first, arm = state.started_with, observation.arm
        assert first is not None
        off = np.abs(arm.position - first.arm.position).max()
        is_back = max(off, np.abs(observation.joint_error).max()) <= following.contact
        is_at_rest = np.abs(arm.velocity).max() < self._timing.at_rest
        if state.is_planning or state.performed < observation.tau or not (is_back and is_at_rest):
            return state
        return state.anew(self._time)


def _leads_on(pending: Pending) -> bool:
    """True for a movement other than a retreat."""
    movement = None if pending.plan is None else pending.plan.movement
    returns = movement is not None and movement.origin == Origin.RETURN
    return pending.effect == Effect.MOVEMENT and (returns or pending.suspended_plan is None)
