"""Supervision before the arm moves: search for the goal, base placement and the drive."""

from dataclasses import replace

import numpy as np

from pepper_drake.planning.reach.likely_cause import likely_cause
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_parameters import ReachTiming
from pepper_drake.planning.reach.reach_plan import Planner, PlanStatus, ReachPlan
from pepper_drake.planning.reach.reach_state import NOWHERE, Effect, Pending, ReachState

ROUNDING = 1e-9
"""Tolerance of times [s]."""


class DriveSupervision:
    """One step while the robot looks for the goal and drives; see `reach_state_machine.step`.

    Args:
        observation: The present one.
        planner: Finds plans.
        timing: Durations, timeouts and latencies.
    """

    def __init__(self, observation: Observation, planner: Planner, timing: ReachTiming) -> None:
        self._observation, self._planner, self._timing = observation, planner, timing
        self._time = observation.time

    def look(self, state: ReachState) -> ReachState:
        """Searches for the goal, looks at the scene, then plans the base placement."""
        timing, time = self._timing, self._time
        if state.is_planning:
            return self._look_ahead_of_drive(state) if state.placement is None else state
        if state.placement is not None:
            return self._check_drive(state, state.placement)
        if not self._observation.goal_valid:
            longest = timing.goal_timeout
            if self._observation.image_ages.min() < timing.images_lost:
                longest += self._observation.search_delay
            if time - state.since > longest:
                message = f"no marker of the goal object was seen in {longest:.3g} s"
                return self._goal_unseen(state, "goal_not_seen", message)
            return state
        if np.isnan(state.goal_seen_since):
            return replace(state, goal_seen_since=time)
        if time - state.goal_seen_since < timing.looking:
            return state
        if self._observation.cloud_age > timing.cloud_timeout:
            if time - state.goal_seen_since > timing.goal_timeout:
                return state.fail(time, "cloud_missing", self._observation.cloud_message)
            return state
        return self._place_base(state)

    def _place_base(self, state: ReachState) -> ReachState:
        if not self._timing.drives:
            return replace(state.to(ReachMode.SETTLING, self._time), arrived=self._time)
        looking = self._look_ahead_of_drive(state)
        plan = self._planner.plan_base_placement(self._without_predictions())
        due = self._time + self._timing.latency.base_placement
        return looking.later(Pending(due, Effect.PLACEMENT, plan))

    def _look_ahead_of_drive(self, state: ReachState) -> ReachState:
        """While the base placement is planned, looks along the likely drive with each new cloud."""
        observation = self._observation
        if (
            not self._planner.params.unseen.check_drive
            or observation.cloud_time == state.cloud_time
        ):
            return state
        x, y, z = self._planner.look_along_drive(self._without_predictions())
        due = self._time + self._timing.latency.drive
        looking = state.later(Pending(due, Effect.LOOK, look_at=(x, y, z)))
        return replace(looking, cloud_time=observation.cloud_time)

    def _check_drive(self, state: ReachState, placement: ReachPlan) -> ReachState:
        """Checks with each new cloud whether all space swept by the drive has been seen."""
        observation, timing = self._observation, self._timing
        if observation.cloud_age > timing.cloud_lost:
            return state.fail(self._time, "cloud_missing", observation.cloud_message)
        if observation.cloud_age > timing.cloud_timeout:
            return state
        if observation.cloud_time == state.cloud_time:
            return state
        plan = self._planner.check_drive(placement, self._without_predictions())
        state = replace(state, cloud_time=observation.cloud_time)
        return state.later(Pending(self._time + timing.latency.drive, Effect.PLACEMENT, plan))

    def placed(self, state: ReachState, plan: ReachPlan) -> ReachState:
        """Drives to the planned base placement, looks along the drive first, or fails."""
        time = self._time
        if plan.status == PlanStatus.NOT_SEEN:
            return self._look_along_drive(state, plan)
        is_blocked = state.placement is not None and plan.status == PlanStatus.NO_STANDING_ROOM
        if (
            is_blocked
            and state.mode == ReachMode.LOOKING
            and state.places < self._timing.max_base_placements
        ):
            return self._place_base(replace(state, placement=None, places=state.places + 1))
        if plan.status != PlanStatus.CLEAR:
            return state.fail(time, plan.status.value, plan.message)
        x, y, yaw = plan.base_pose
        return replace(
            state.to(ReachMode.DRIVING, time),
            base_pose_wanted=(x, y, yaw),
            hip_pitch_wanted=state.hip_pitch_wanted if plan.hip_pitch is None else plan.hip_pitch,
            places=state.places + 1,
            placement=plan,
            plan=None,
            look_at=NOWHERE,
        )

    def _look_along_drive(self, state: ReachState, plan: ReachPlan) -> ReachState:
        """Looks at the unseen space that the drive would sweep."""
        is_looking = state.mode == ReachMode.LOOKING and state.placement is not None
        if is_looking and self._has_look_timed_out(state):
            return state.fail(self._time, plan.status.value, plan.message)
        if not is_looking:
            # The plan is older than the look along the likely drive, which goes on until checked.
            looking = state.to(ReachMode.LOOKING, self._time)
            return replace(looking, placement=plan, cloud_time=np.nan)
        x, y, z = plan.look_at
        return replace(state, placement=plan, look_at=(x, y, z))

    def drive(self, state: ReachState) -> ReachState:
        """Waits until base and torso arrive; without depth images both stand still."""
        time, is_blind = self._time, self._observation.cloud_age > self._timing.cloud_timeout
        if is_blind:
            state = state.without_images(self._timing.time_step, self._observation.cloud_fault)
        elif state.braking:
            state = replace(state, braking=False)
        if time - state.since > self._timing.driving_timeout:
            message = "the robot did not get to where its arm can reach the goal"
            if self._observation.base_blocked:
                message += ": something stands in its way"
            elif self._is_jittering(state):
                cause = "the base is at its place, and does not come to rest there"
                return self._fail(state, "base_unsteady", cause)
            return self._fail(state, "drive_failed", message)
        # In the step in which a goal is sent, the base still reports on the old one.
        has_started = time - state.since > self._timing.time_step + ROUNDING
        if self._observation.base_arrived and has_started and not state.braking:
            return replace(state.to(ReachMode.SETTLING, time), arrived=time)
        return state

    def _is_jittering(self, state: ReachState) -> bool:
        """Tells whether the base still moves at its place."""
        before = state.steadiness.last
        if before is None:
            return False
        pose = self._observation.base_pose
        moved = float(np.linalg.norm((pose - before.base_pose)[:2]))
        off = float(np.linalg.norm((pose - state.base_pose_wanted)[:2]))
        return off < self._timing.base_near and moved > self._timing.steadiness.base

    def _without_predictions(self) -> Observation:
        """Drops the predictions: before it starts, the arm simply waits for moving obstacles."""
        return self._observation.with_cloud(self._observation.cloud)

    def _has_look_timed_out(self, state: ReachState) -> bool:
        return self._time - state.since >= self._timing.unseen_timeout - ROUNDING

    def _goal_unseen(self, state: ReachState, reason: str, message: str) -> ReachState:
        """Returns the failed state of an unseen goal; missing images are named as the cause."""
        if self._observation.image_ages.max() > self._timing.images_lost:
            reason, message = "images_missing", self._observation.image_message
        return state.fail(self._time, reason, message)

    def _fail(self, state: ReachState, reason: str, message: str) -> ReachState:
        """Returns the failed state, with the likely cause, if known, in place of the symptom."""
        cause = likely_cause(state, self._observation, self._planner.params, message)
        return state.fail(self._time, *(cause or (reason, message)))
