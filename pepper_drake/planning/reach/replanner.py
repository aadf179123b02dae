"""Online replanning: detours and retreats when obstacles appear on the arm's path."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from pepper_drake.perception.mapping.voxel_map import one_per_voxel
from pepper_drake.planning.reach.hanging_things import hanging_things
from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.reach.movement_origin import Origin
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_parameters import ReachTiming
from pepper_drake.planning.reach.reach_plan import Planner, PlanStatus, ReachPlan
from pepper_drake.planning.reach.reach_state import Effect, Pending, ReachState
from pepper_drake.planning.reach.separation import StaleSpace, escapes
from pepper_drake.planning.safety.compiled_limits import stopping_distance
from pepper_drake.planning.trajectories.retreat import (
    dilate_new_points,
    extrude_new_points_down,
    new_points,
)

Vector = npt.NDArray[np.float64]


def leads_elsewhere(plan: ReachPlan, observation: Observation, tolerance: float) -> bool:
    """True if the goal has moved so far that a plan's clearance is not that of its movement.

    The taught movement follows the goal, as primitives do; one that was adapted to obstacles was so
    for one goal.

    Args:
        plan: The plan that is performed.
        observation: The present one.
        tolerance: Displacement of the goal that does not matter [m].
    """
    taught = plan.movement is not None and plan.movement.origin == Origin.TAUGHT
    if plan.p_WO is None or taught:
        return False
    return float(np.linalg.norm(observation.p_WO - plan.p_WO)) > tolerance


@dataclass(frozen=True)
class ReachReplanner:
    """Checks the rest of a movement against each new cloud.

    If it is not clear, a detour is planned. If there is none, or if the obstacle moves, the arm
    retreats to a configuration with more clearance, waits, and resumes when the path is clear. A
    plan takes effect `latency.plan` after the cloud. Until then the old movement goes on, unless
    the obstacle moves or the path up to that time is not clear: then the arm brakes, which needs no
    plan, `latency.check` after the cloud.

    Attributes:
        planner: Finds detours and retreats.
        timing: Latencies and waiting times.
    """

    planner: Planner
    timing: ReachTiming

    def is_free(self, plan: ReachPlan, observation: Observation) -> bool:
        """True if the rest of a plan's path keeps its clearance."""
        rest = self.planner.remaining_clearance(plan, observation)
        return rest.minimum >= self._replan_clearance(plan)

    def __call__(self, state: ReachState, observation: Observation) -> ReachState:
        """Returns the state after a new cloud, with decisions in `pending`."""
        plan, time, latency = state.plan, observation.time, self.timing.latency
        assert plan is not None
        has_waited = self._has_waited(state, time)
        new = self._new_obstacle(state, observation)
        if state.suspended_plan is not None and len(new):
            # The head looks at what the arm waits for: unseen, it would not be seen to leave.
            x, y, z = new.mean(axis=0)
            state = replace(state, look_at=(x, y, z))
        stands = has_waited and self._stands(state, observation)
        if stands:
            # An obstacle that has stood still for the whole wait no longer counts as new.
            known = observation if state.planned_with is None else state.planned_with
            state = replace(state, planned_with=known.with_cloud(observation.obstacles))
        seen = observation.with_cloud(self._with_hidden_sides(state, observation))
        is_under_way = state.suspended_plan is None
        reach = plan if state.suspended_plan is None else state.suspended_plan
        rest = self.planner.remaining_clearance(reach, seen)
        returns = plan.movement is not None and plan.movement.origin == Origin.RETURN
        if is_under_way or returns:
            # A new obstacle without a predicted motion is stationary.
            moving = new if len(observation.predicted_cloud) else new[:0]
            hanging, coming = hanging_things(observation, self.planner.params.new_obstacle)
            movable = np.concatenate((moving, state.hanging, hanging))
            near = np.concatenate((new, coming))
            stale = self.planner.stale_space(plan, observation, near, movable)
            # A narrow place slows the arm in the same way.
            ahead = rest if is_under_way else self.planner.remaining_clearance(plan, seen)
            narrow = ahead.time_below(self.planner.params.clearance.slow)
            stale = stale._replace(time=state.performed + min(stale.time, narrow))
            state = replace(state, look_at=stale.place, stale=stale)
        elif not state.braking:
            state = replace(state, stale=self._retreat_separation(plan, observation, new))
        is_free = rest.minimum >= self._replan_clearance(reach)
        tolerance = self.planner.params.tolerance
        may_go_on = is_free and is_under_way and not state.braking
        if may_go_on and not leads_elsewhere(reach, observation, tolerance.followed):
            return state
        # The arm will retreat from a moving obstacle anyway, so it brakes at once.
        is_urgent = (
            len(observation.predicted_cloud) > 0
            or rest.within(latency.plan + 2.0 * latency.check) < self.planner.params.clearance.start
        )
        if is_under_way and not is_free and not state.will_brake and is_urgent:
            state = state.later(Pending(time + latency.check, Effect.BRAKE))
        if state.is_planning:
            return state
        start, due = self._predicted_start(state, observation)
        # A moving obstacle is too uncertain to pass: the arm waits for it to leave.
        may_pass = is_under_way and not len(observation.predicted_cloud)
        if is_free or has_waited or may_pass:
            detour = self._detour(state, reach, observation.with_arm(start), seen, is_free)
            if detour.status == PlanStatus.CLEAR and (
                is_under_way or stands or detour.clearance >= self._replan_clearance(reach)
            ):
                return state.later(Pending(due, Effect.MOVEMENT, detour, observation))
            state = replace(state, checked=time, message="")
            if detour.status == PlanStatus.NOT_SEEN:
                x, y, z = detour.look_at
                state = replace(state, look_at=(x, y, z), message=detour.message)
        if may_go_on:
            # It follows the goal a little, and brakes rather than go where nothing was checked.
            if state.will_brake or not leads_elsewhere(reach, observation, tolerance.jumped):
                return state
            return state.later(Pending(time + latency.check, Effect.BRAKE))
        if state.suspended_plan is None or has_waited:
            state = replace(state, waits_with=observation)
        return self._retreat(state, reach, seen.with_arm(start), due)

    def plan_return(self, state: ReachState, observation: Observation) -> tuple[ReachPlan, float]:
        """Returns a plan back to the posture of the arm's start, and when it takes effect [s].

        It keeps clear of all that a retreat keeps clear of.
        """
        first = state.started_with
        assert first is not None
        start, due = self._predicted_start(state, observation)
        seen = observation.with_cloud(self._with_hidden_sides(state, observation))
        seen = self._with_former_places(state, seen).with_arm(start)
        travelled = state.travelled_to(start.position)
        return self.planner.plan_return(travelled, first.arm.position, seen), due

    def _with_former_places(self, state: ReachState, seen: Observation) -> Observation:
        """Adds the obstacles of the last plan: one that has left its place may come back to it."""
        if state.planned_with is None:
            return seen
        spacing, former = self.planner.params.new_obstacle.spacing, state.planned_with.cloud
        left = np.isinf(seen.known.distance(former, spacing))
        return seen.with_cloud(np.concatenate((seen.cloud, former.compress(left, axis=0))))

    def _new_obstacle(self, state: ReachState, observation: Observation) -> Vector:
        """Returns points (N, 3) near the goal where nothing was when the arm started [m]."""
        began = state.started_with
        if began is None:
            return np.zeros((0, 3))
        params = self.planner.params.new_obstacle
        new = new_points(observation.cloud, began.known, observation.p_WO, params)
        new = new[one_per_voxel(new, params.spacing)]
        return new if len(new) >= params.min_points else new[:0]

    def _retreat_separation(
        self, plan: ReachPlan, observation: Observation, new: Vector
    ) -> StaleSpace:
        """Returns the distance to new points (N, 3) [m] that a retreat does not move away from.

        A retreat goes back where the arm came from, and no slower than it can as long as it escapes
        from what came. Past it the arm is as slow as on any other movement: the part of it that is
        nearest to the arm is often hidden by the arm.
        """
        if not len(new):
            return StaleSpace()
        rest = self.planner.remaining_clearance(plan, observation.with_cloud(new))
        soon = self.planner.params.new_obstacle.escape_time
        if escapes(rest.times, rest.distances, soon, self.timing.separation):
            return StaleSpace()
        return self.planner.stale_space(plan, observation, new, new[:0])._replace(time=np.inf)

    def _replan_clearance(self, plan: ReachPlan) -> float:
        """Returns the clearance below which a movement is replanned [m]."""
        return min(
            self.planner.params.clearance.replan, plan.clearance - self.timing.replan_clearance_loss
        )

    def _has_waited(self, state: ReachState, time: float) -> bool:
        """True if `detour_delay` is over since the arm retreated or last found no detour."""
        last = max(state.since, state.checked)
        return state.suspended_plan is not None and time - last >= self.timing.detour_delay

    def _stands(self, state: ReachState, observation: Observation) -> bool:
        """True if the predicted obstacles have not moved since `waits_with`."""
        predicted, before = observation.predicted_cloud, state.waits_with
        if not len(predicted):
            return True
        if before is None or not len(before.predicted_cloud):
            return False
        stationary_tolerance = self.planner.params.new_obstacle.stationary_tolerance
        tree = cKDTree(before.predicted_cloud)
        distances = tree.query(predicted, distance_upper_bound=stationary_tolerance)[0]
        return bool(np.isfinite(distances).all())

    def _with_hidden_sides(self, state: ReachState, observation: Observation) -> Vector:
        """Returns the obstacles (P, 3) [m], new ones extended by their occluded sides."""
        if state.planned_with is None:
            return observation.obstacles
        moving = len(observation.predicted_cloud) > 0
        return self._extended(observation, state.planned_with, moving=moving, dilated=moving)

    def _extended(
        self, observation: Observation, planned_with: Observation, *, moving: bool, dilated: bool
    ) -> Vector:
        """Returns the obstacles (P, 3) [m], new ones extruded and, if asked for, dilated."""
        known, params = planned_with.known, self.planner.params.new_obstacle
        cloud, p_WO = observation.obstacles, observation.p_WO
        sides = new_points(cloud, known, p_WO, params)
        if dilated:
            sides = dilate_new_points(sides, known, p_WO, moving=moving, params=params)
        sides = extrude_new_points_down(sides, known, p_WO, params)
        # Many lie close together, and would be most of all points.
        sides = sides[one_per_voxel(sides, params.spacing)]
        return np.concatenate((cloud, sides))

    def _predicted_start(
        self, state: ReachState, observation: Observation
    ) -> tuple[ArmState, float]:
        """Returns the arm's command when a plan takes effect, and that time [s].

        A braking arm comes to rest before another movement begins.
        """
        plan, latency, time = state.plan, self.timing.latency, observation.time
        assert plan is not None
        arm, tick = observation.arm, plan.time_step

        def predict(duration: float) -> ArmState:
            if leads_elsewhere(plan, observation, self.planner.params.tolerance.followed):
                # An arm that follows the goal is not on the plan's path.
                return ArmState(arm.position + duration * arm.velocity, arm.velocity)
            timing_error = self.timing.timing_error
            return plan.predict(arm, state.performed, duration, state.speed, timing_error)

        def until_effect(latency: float) -> float:
            # The supervisor adopts a result in its next step, the controller in the tick after.
            period = self.timing.time_step
            taken = period * np.ceil(latency / period - 1e-6)
            return tick * (np.floor(taken / tick + 1e-6) + 1.0)

        if not state.will_brake:
            return predict(until_effect(latency.plan)), time + latency.plan
        reaction = 0.0
        if not state.braking:
            reaction = until_effect(latency.check)
            arm = predict(reaction)
        limits = self.planner.limits
        stopping = [
            np.copysign(stopping_distance(abs(speed), change, tick), speed)
            for speed, change in zip(arm.velocity, tick * limits.acceleration, strict=True)
        ]
        at_rest = time + reaction + float(np.max(np.abs(arm.velocity) / limits.acceleration))
        return (
            ArmState(arm.position + stopping, np.zeros(len(stopping))),
            max(time + latency.plan, at_rest),
        )

    def _detour(
        self,
        state: ReachState,
        reach: ReachPlan,
        observation: Observation,
        seen: Observation,
        is_free: bool,
    ) -> ReachPlan:
        """Returns the best detour, with additional clearance to new obstacles still present."""
        known = state.planned_with
        cloud = seen.cloud
        if known is not None and not is_free:
            cloud = self._extended(observation, known, moving=False, dilated=True)
        around = observation.with_cloud(cloud)
        detour = self.planner.replan(reach, around)
        is_at_rest = np.abs(observation.arm.velocity).max() < self.timing.at_rest
        waited = state.suspended_plan is not None and is_at_rest
        is_clear = detour.status == PlanStatus.CLEAR
        if waited and not (is_clear and detour.clearance >= self.planner.params.clearance.resume):
            anew = self.planner.check_reach(around)
            is_better = not is_clear or anew.clearance > detour.clearance
            if anew.status == PlanStatus.CLEAR and is_better:
                return anew
            # Where to look for a path that is clear but for what is unseen.
            if anew.status == PlanStatus.NOT_SEEN and not is_clear:
                return anew
        return detour

    def _retreat(
        self, state: ReachState, reach: ReachPlan, seen: Observation, due: float
    ) -> ReachState:
        """Retreats at a time [s], or stays if the arm is already clear of the obstacle."""
        plan = state.plan
        assert plan is not None
        waits = state.suspended_plan is not None and not state.braking
        if waits and self.is_free(plan, seen):
            return state
        seen = self._with_former_places(state, seen)
        retreat = self.planner.plan_retreat(state.travelled_to(seen.arm.position), seen)
        if waits and not self._is_better(retreat, plan, seen):
            return state  # There is no better place than where the arm is going.
        return state.later(Pending(due, Effect.MOVEMENT, retreat, suspended_plan=reach))

    def _is_better(self, retreat: ReachPlan, plan: ReachPlan, seen: Observation) -> bool:
        """True if a retreat has more clearance than the rest of another, on its path or at its end.

        Each new retreat brakes first: one that gains little would lose time.
        """
        rest = self.planner.remaining_clearance(plan, seen)
        least = self.planner.params.retreat.max_clearance_loss
        if retreat.clearance > rest.minimum + least:
            return True
        if retreat.joint_path is None:
            return False
        end = self.planner.remaining_clearance(retreat, seen).distances[-1]
        return bool(end > rest.distances[-1] + least)
