"""Supervision of a reach as a pure function of state and observation."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pepper_drake.planning.reach.drive_supervision import ROUNDING
from pepper_drake.planning.reach.hanging_things import hanging_things
from pepper_drake.planning.reach.likely_cause import with_cause
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_parameters import ReachTiming
from pepper_drake.planning.reach.reach_plan import Planner, PlanStatus, ReachPlan
from pepper_drake.planning.reach.reach_state import NOWHERE, RESTS, Effect, Pending, ReachState
from pepper_drake.planning.reach.replanner import leads_elsewhere
from pepper_drake.planning.reach.return_supervision import ReturnSupervision
from pepper_drake.planning.reach.separation import changed_speed, speed_fraction
from pepper_drake.planning.reach.steadiness import Steadiness
from pepper_drake.planning.safety.command_check import StopReason, stop_sentence

UNCONFIRMED = "reached_unconfirmed"
"""Outcome of a reach whose goal was not seen recently."""


def step(
    state: ReachState,
    observation: Observation,
    planner: Planner,
    timing: ReachTiming,
) -> ReachState:
    """Returns the state after an observation.

    LOOKING (find the goal, look at the scene) → DRIVING (to a base placement) → SETTLING (stand,
    look again, check the reach) → REACHING → HOLDING → DONE; from each of them to FAILED, where the
    arm holds still. From HOLDING back to REACHING when the goal moves on or something comes, and
    from REACHING to LOOKING if the goal is not reached from where the robot stands: it drives to
    another base placement. Plans take effect after `timing.latency`.

    Args:
        state: State before.
        observation: The present one.
        planner: Finds plans; must be stateless.
        timing: Durations, timeouts and latencies.
    """
    if state.mode in RESTS:
        return state
    after = _step(state, observation, planner, timing)
    if state.has_started:
        return after
    return _with_first_reason(with_cause(after, timing.steadiness), state.given_up)


def _step(
    state: ReachState, observation: Observation, planner: Planner, timing: ReachTiming
) -> ReachState:
    supervision = _Supervision(observation, planner, timing)
    if state.has_started or state.steadiness.is_due(observation.time, timing.steadiness):
        steadiness = state.steadiness.advanced(observation, timing.steadiness)
        if not state.has_started:
            steadiness = steadiness.of_moving_base()
        state = replace(state, steadiness=steadiness)
    if state.has_started:
        state = state.after(timing.time_step)
    failed = supervision.fault(state)
    if failed is not None:
        return failed
    state = supervision.take_effect(state)
    handlers: dict[ReachMode, Callable[[ReachState], ReachState]] = {
        ReachMode.LOOKING: supervision.look,
        ReachMode.DRIVING: supervision.drive,
        ReachMode.SETTLING: supervision.settle,
        ReachMode.REACHING: supervision.reach,
        ReachMode.HOLDING: supervision.hold,
    }
    handler = handlers.get(state.mode)
    return state if handler is None else supervision.take_effect(handler(state))


def _with_first_reason(state: ReachState, given_up: tuple[str, str] | None) -> ReachState:
    """Returns a state that, where no place is better, fails for why the robot looked for one."""
    if given_up is None or state.mode != ReachMode.FAILED or state.reason not in set(PlanStatus):
        return state
    reason, message = given_up
    return replace(state, reason=reason, message=f"{message}; from elsewhere, {state.message}")


class _Supervision(ReturnSupervision):
    """One step of the supervision, for one observation."""

    def fault(self, state: ReachState) -> ReachState | None:
        """Returns the failed state if the reach cannot go on, else None."""
        observation, timing, time = self._observation, self._timing, self._time
        stop = observation.stop_reason
        unsteady = None
        if state.has_started:
            unsteady = state.steadiness.unsteady_signal(timing.steadiness)
        if stop != StopReason.NONE:
            sentence = stop_sentence(stop, observation.stop_joint)
            if unsteady is None and stop == StopReason.LINK_TOO_CLOSE:
                return self._fail(state, stop.name.lower(), sentence)
            if unsteady is None or stop == StopReason.REQUESTED:
                return state.fail(time, stop.name.lower(), sentence)
            return state.fail(time, unsteady[0], f"{unsteady[1]}; {sentence}")
        if state.mode == ReachMode.LOOKING:
            return None
        may_be_unseen = state.mode == ReachMode.HOLDING or state.given_up is not None
        if observation.goal_age > timing.goal_lost and not may_be_unseen:
            message = f"the goal's marker was not seen for {timing.goal_lost:g} s"
            return self._goal_unseen(state, "goal_lost", message)
        if observation.cloud_age > timing.cloud_lost:
            return state.fail(time, "cloud_missing", self._observation.cloud_message)
        if unsteady is not None:
            return state.fail(time, *unsteady)
        slowed = min(state.slowed, timing.max_slowdown_extension)
        longest = timing.reach_timeout + slowed + state.held
        is_reaching = state.mode == ReachMode.REACHING and state.given_up is None
        if is_reaching and time - state.started > longest:
            message = f"the hand had not arrived {longest:.0f} s after the arm started"
            return self._fail(state, "timeout", message)
        return None

    def take_effect(self, state: ReachState) -> ReachState:
        """Returns the state after all computations that have finished."""
        while due := [one for one in state.pending if one.due <= self._time + ROUNDING]:
            first = min(due, key=lambda one: one.due)
            rest = tuple(one for one in state.pending if one is not first)
            state = self._apply(replace(state, pending=rest), first)
        return state

    def _apply(self, state: ReachState, result: Pending) -> ReachState:
        """Returns the state after one computation."""
        time, plan = self._time, result.plan
        if result.effect == Effect.BRAKE:
            return replace(state, braking=True)
        if result.effect == Effect.START:
            starting = state.to(ReachMode.REACHING, time)
            return replace(
                starting,
                movements=state.movements + 1,
                started=time,
                look_at=NOWHERE,
                given_up=None,
                steadiness=Steadiness(),
            )
        if result.effect == Effect.LOOK:
            return replace(state, look_at=result.look_at) if state.is_placing else state
        assert plan is not None
        if plan.status == PlanStatus.CLEAR or result.effect == Effect.MOVEMENT:
            # Only a base placement must be near the goal; later the goal may have moved away.
            is_placed = result.effect == Effect.PLACEMENT
            params = self._planner.params
            farthest = params.obstacle_range if is_placed else np.inf
            p_WO = (result.observation or self._observation).p_WO
            if (invalid := plan.invalid_reason(p_WO, farthest, params.tolerance.moved)) is not None:
                return state.fail(time, "plan_invalid", invalid)
        if result.effect == Effect.MOVEMENT:
            if plan.movement is None:
                return state.fail(time, "plan_invalid", "the planner gave no movement to switch to")
            moving = state.to(ReachMode.REACHING, time)
            if state.mode == ReachMode.HOLDING:
                moving = replace(moving, held=state.held + time - state.since)
            elif state.given_up is not None and result.suspended_plan is None:
                held = state.held + time - state.given_up_at
                moving = replace(moving, given_up=None, held=held)
            return moving.with_plan(plan, time, result.suspended_plan)
        if result.effect == Effect.CHECK:
            if plan.status == PlanStatus.CLEAR:
                seen = result.observation
                assert seen is not None
                hanging = hanging_things(seen, self._planner.params.new_obstacle).all
                return replace(
                    state, plan=plan, planned_with=seen, started_with=seen, hanging=hanging
                )
            if plan.status == PlanStatus.NOT_SEEN and not self._has_look_timed_out(state):
                x, y, z = plan.look_at
                return replace(state, plan=None, look_at=(x, y, z))
            if not self._has_settled(state):
                return replace(state, plan=None)  # The map still improves while the robot stands.
            if self._may_drive(state) and state.places < self._timing.max_base_placements:
                return self._place_base(state)
            return state.fail(time, plan.status.value, plan.message)
        return self.placed(state, plan)

    def _has_settled(self, state: ReachState) -> bool:
        return self._time - state.since >= self._timing.settling - ROUNDING

    def settle(self, state: ReachState) -> ReachState:
        """Plans while the robot settles, then checks the plan against the latest observation."""
        timing, time = self._timing, self._time
        if state.is_placing:
            return self._look_ahead_of_drive(state)
        if state.is_planning:
            return state
        has_settled = self._has_settled(state)
        if state.plan is not None:
            if not has_settled:
                return state
            if self._is_confirmed(state, state.plan):
                return state.later(Pending(time + timing.latency.check, Effect.START))
        elif not has_settled and (
            time - state.since < 0.5 * timing.settling - ROUNDING or state.checked >= state.since
        ):
            return state
        if time - state.since > timing.settling_timeout:
            message = "the scene changed so often that no plan for the arm could be confirmed"
            return self._fail(state, PlanStatus.NO_CLEAR_PATH.value, message)
        seen = self._without_predictions()
        movement = None if state.placement is None else state.placement.movement
        plan = self._planner.check_reach(seen, movement)
        due = time + timing.latency.plan
        planning = state.later(Pending(due, Effect.CHECK, plan, self._observation))
        return replace(planning, plan=None, checked=time)

    def _is_confirmed(self, state: ReachState, plan: ReachPlan) -> bool:
        """True if the present observation agrees with a plan."""
        if plan.joint_path is None or not plan.collision_checked or state.planned_with is None:
            return True
        moved = np.linalg.norm(self._observation.p_WO - state.planned_with.p_WO)
        same_goal = bool(moved <= self._planner.params.tolerance.moved)
        return same_goal and self._replanner.is_free(plan, self._without_predictions())

    def _look_ahead(self, state: ReachState) -> ReachState:
        """Checks the rest of the movement against a new cloud; see `ReachReplanner`."""
        observation, plan = self._observation, state.plan
        if observation.cloud_age > self._timing.cloud_timeout:
            pending = state.pending if state.braking else ()
            waiting = state.without_images(self._timing.time_step, observation.cloud_fault)
            return replace(waiting, pending=pending)
        if observation.predicted_clearance < self._planner.params.clearance.stop:
            # The prediction may be wrong: the arm brakes until the next cloud.
            state = state if state.braking else replace(state, braking=True)
        if plan is None or observation.cloud_time == state.cloud_time:
            return state
        state = replace(state, cloud_time=observation.cloud_time)
        if plan.joint_path is None or not plan.collision_checked:
            return state.with_plan(plan, self._time) if state.braking else state
        return self._replanner(state, observation)

    def _pace(self, state: ReachState) -> ReachState:
        """Slows the movement down before space that was not seen recently; see `separation`."""
        if not state.active_movement or state.is_planning:
            return state  # The start of the plan being computed was predicted at this speed.
        params, stale = self._timing.separation, state.stale
        wanted = speed_fraction(stale._replace(time=stale.time - state.performed), params)
        speed = changed_speed(state.speed, wanted, self._timing.time_step, params)
        return state if speed == state.speed else replace(state, speed=speed)

    def reach(self, state: ReachState) -> ReachState:
        """Checks and replans the movement until the hand has arrived."""
        before, state = state, self._pace(self._look_ahead(state))
        timing, time = self._timing, self._time
        if state.given_up is not None:
            return self.go_back(state, state.given_up, before.cloud_time)
        tolerance, following = self._planner.params.tolerance, self._planner.params.following
        suspended = state.suspended_plan
        if suspended is not None:
            return self._wait(state, suspended, before.waits_with)
        if state.braking:
            return state
        elapsed, error, tau = (
            state.performed,
            self._observation.goal_distance,
            self._observation.tau,
        )
        behind = self._observation.following_error
        if behind > following.stop:
            message = f"the hand fell {1000 * behind:.0f} mm behind its movement"
            return self._fail(state, PlanStatus.CANNOT_FOLLOW.value, message)
        if elapsed >= tau and error <= tolerance.arrive:
            if np.isnan(state.still_since):
                return replace(state, still_since=time)
            if time - state.still_since >= timing.dwell - ROUNDING:
                return state.to(ReachMode.HOLDING, time)
            return state
        if elapsed > timing.movement_timeout_ratio * tau:
            if error <= tolerance.accept:
                return state.to(ReachMode.HOLDING, time)
            return self._not_reached(state, error)
        return state if np.isnan(state.still_since) else replace(state, still_since=np.nan)

    def _not_reached(self, state: ReachState, error: float) -> ReachState:
        """Gives up a goal that the hand stays off by some distance [m]."""
        message = f"the hand stayed {1000 * error:.0f} mm from its goal"
        return self.give_up(state, self._fail(state, "not_reached", message))

    def _wait(
        self, state: ReachState, suspended: ReachPlan, waits_with: Observation | None
    ) -> ReachState:
        """Waits for the path to become clear; gives up at last.

        Args:
            state: The present state.
            suspended: The plan to resume.
            waits_with: The observation since which the arm waits, or with the last search.
        """
        timing, tolerance = self._timing, self._planner.params.tolerance
        state = replace(state, waited=state.waited + timing.time_step)
        moved = leads_elsewhere(suspended, self._observation, tolerance.jumped)
        is_over = state.waited > timing.blocked_timeout
        # A goal that has moved away and rests is not waited for, once no path to it was found.
        searched = state.checked == self._time >= state.since + timing.detour_delay
        rests = waits_with is not None and (
            np.linalg.norm(self._observation.p_WO - waits_with.p_WO) <= tolerance.followed
        )
        if not is_over and not (moved and searched and rests):
            return state
        unseen = f": {state.message}" if state.message else ""
        message = f"something came in the way and has not gone{unseen}"
        if moved:
            message = "no clear path leads to it from here"
        after = self.give_up(state, self._fail(state, PlanStatus.NO_CLEAR_PATH.value, message))
        return after if is_over or after.mode != ReachMode.FAILED else state

    def hold(self, state: ReachState) -> ReachState:
        """Holds until the goal is seen again, then ends; retreats from obstacles."""
        before, timing, time = state, self._timing, self._time
        state = self._pace(self._look_ahead(state))
        if state.given_up is not None:
            return self.go_back(state, state.given_up, before.cloud_time)
        error = self._observation.goal_distance
        is_there = error <= self._planner.params.tolerance.followed
        if is_there != np.isnan(state.off_since):
            state = replace(state, off_since=np.nan if is_there else time)
        held, age = time - state.since, self._observation.goal_age
        if state.braking or state.is_planning or held < timing.holding - ROUNDING:
            return state
        if not is_there:  # The hand follows, if it can.
            is_slow = time - state.off_since > self._observation.tau
            return self._not_reached(state, error) if is_slow else state
        if age <= timing.goal_confirmed:
            return state.to(ReachMode.DONE, time)
        if held < timing.holding + timing.confirmation_timeout and age <= timing.goal_lost:
            return state
        message = f"the hand is where the goal was last seen, {age:.1f} s ago"
        done = state.to(ReachMode.DONE, time)
        return replace(done, reason=UNCONFIRMED, message=message)
