"""Decides what Pepper does next: look, drive up, reach, hold, or stop and say why."""

from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud
from pydrake.systems.framework import (
    BasicVector,
    Context,
    EventStatus,
    InputPort,
    LeafSystem,
    State,
)
from scipy.spatial import cKDTree

from pepper_drake.models.control_model import BODY_JOINTS
from pepper_drake.perception.mapping.cloud_points import cloud_points
from pepper_drake.perception.mapping.depth_validity import FAULT_SENTENCES, DepthFault
from pepper_drake.planning.ik.command_check import STOP_SENTENCES, StopReason
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.reach_planner import PlanStatus, ReachPlanner
from pepper_drake.planning.reach.reach_state import ReachState, ReachTiming
from pepper_drake.planning.reach.replanner import Observation, ReachReplanner

Vector = npt.NDArray[np.float64]

_NEAR = 0.6
"""What moves farther from the goal than this is not waited for [m]."""


class ReachSupervisor(LeafSystem):
    """The reach as a sequence of modes.

    LOOKING (find the goal, take in the scene) → DRIVING (to where the arm can reach) → SETTLING
    (stand, look again, check the reach) → REACHING → HOLDING → DONE; from everywhere to FAILED,
    where the arm holds still. Whether, and from where, the goal can be reached is the planner's
    to say, before the arm moves.

    .. pydrake_system::

        name: ReachSupervisor
        input_ports:
        - object_pose
        - goal_valid
        - goal_age
        - goal_position
        - cloud
        - cloud_time
        - cloud_age (optional)
        - cloud_fault (optional)
        - approaching (optional)
        - joint_position
        - base_pose
        - hand_pose
        - desired_position (optional)
        - arm_position_command (optional)
        - arm_velocity_command (optional)
        - arrived
        - tau
        - stop_reason
        output_ports:
        - movement
        - base_goal
        - resting_head
        - mode
        - progress

    Inputs: `object_pose` X_WO; `goal_valid`, `goal_age` (1; s); `goal_position` (3), the hand's
    goal in T; `cloud` (PointCloud in W) and `cloud_time` (1; time of its last frame, not finite
    before the first); `cloud_age` (1) [s] and `cloud_fault` (1; a `DepthFault`), without which a
    cloud that has grown old is not noticed; `approaching` (PointCloud in W), where what moves will
    be soon;
    `joint_position` (15); `base_pose` (3); `hand_pose` X_TH and `desired_position` (3), where the
    primitive wants the hand in T; `arm_position_command` and `arm_velocity_command` (5), rad and
    rad/s, without which a movement is not planned anew on the way; `arrived` (1); `tau` (1; s);
    `stop_reason` (1; the safety monitor's `StopReason`).
    Outputs: `movement`, abstract Movement: the one that runs, by number, or number 0 of the one
    that is next; `base_goal` (3), NaN for "stay"; `resting_head` (2), head yaw and pitch [rad] of
    the search for the goal;
    `mode` (1), a `ReachMode`; `progress`, the whole `ReachState`.
    State: `ReachState` (abstract), at `time_step`.
    """

    def __init__(
        self, planner: ReachPlanner, timing: ReachTiming, *, time_step: float = 0.05
    ) -> None:
        super().__init__()
        self._planner, self._timing, self._time_step = planner, timing, time_step
        self._reaction = ReachReplanner(planner, timing)
        self._ports: dict[str, InputPort] = {
            name: self.DeclareAbstractInputPort(name, value)
            for name, value in (
                ("object_pose", Value(RigidTransform())),
                ("cloud", Value(PointCloud())),
                ("approaching", Value(PointCloud())),
                ("hand_pose", Value(RigidTransform())),
            )
        }
        for name, size in (
            ("goal_valid", 1),
            ("goal_age", 1),
            ("goal_position", 3),
            ("cloud_time", 1),
            ("cloud_age", 1),
            ("cloud_fault", 1),
            ("joint_position", len(BODY_JOINTS)),
            ("base_pose", 3),
            ("desired_position", 3),
            ("arm_position_command", 5),
            ("arm_velocity_command", 5),
            ("arrived", 1),
            ("tau", 1),
            ("stop_reason", 1),
        ):
            self._ports[name] = self.DeclareVectorInputPort(name, size)
        self._progress = self.DeclareAbstractState(Value[object](ReachState()))
        state = {self.abstract_state_ticket(self._progress)}
        self.DeclareVectorOutputPort(
            "base_goal", 3, self._calc_base_goal, prerequisites_of_calc=state
        )
        self.DeclareVectorOutputPort(
            "resting_head",
            2,
            self._calc_resting_head,
            prerequisites_of_calc={self.time_ticket()},
        )
        self.DeclareVectorOutputPort("mode", 1, self._calc_mode, prerequisites_of_calc=state)
        self.DeclareAbstractOutputPort(
            "progress",
            lambda: Value[object](ReachState()),
            self._calc_progress,
            prerequisites_of_calc=state,
        )
        self.DeclareAbstractOutputPort(
            "movement",
            lambda: Value[object](planner.demonstrated),
            self._calc_movement,
            prerequisites_of_calc=state,
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(time_step, 0.0, self._update)

    def progress(self, context: Context) -> ReachState:
        """The present state in this context."""
        return context.get_abstract_state(int(self._progress)).get_value()

    def _scalar(self, context: Context, name: str) -> float:
        return float(self._ports[name].Eval(context)[0])

    def _update(self, context: Context, state: State) -> EventStatus:
        before = self.progress(context)
        after = self._next(context, before)
        if after is before:
            return EventStatus.DidNothing()
        state.get_mutable_abstract_state(int(self._progress)).set_value(after)
        return EventStatus.Succeeded()

    def _next(self, context: Context, progress: ReachState) -> ReachState:
        """The mode after this tick."""
        if progress.mode in (ReachMode.DONE, ReachMode.FAILED):
            return progress
        time = context.get_time()
        stop = StopReason(int(self._scalar(context, "stop_reason")))
        if stop != StopReason.NONE:
            return progress.fail(time, stop.name.lower(), STOP_SENTENCES[stop])
        if (
            progress.mode != ReachMode.LOOKING
            and self._scalar(context, "goal_age") > self._timing.goal_lost
        ):
            return progress.fail(
                time,
                "goal_lost",
                f"the goal's marker was not seen for {self._timing.goal_lost:g} s",
            )
        if progress.mode != ReachMode.LOOKING and self._is_cloud_old(context):
            return progress.fail(time, "cloud_missing", self._cloud_message(context))
        step = {
            ReachMode.LOOKING: self._look,
            ReachMode.DRIVING: self._drive,
            ReachMode.SETTLING: self._settle,
            ReachMode.REACHING: self._reach,
            ReachMode.HOLDING: self._hold,
        }[progress.mode]
        return step(context, progress, time)

    def _is_cloud_old(self, context: Context) -> bool:
        """Whether no depth image, or none that counts, has come for too long."""
        port = self._ports["cloud_age"]
        if port.HasValue(context):
            return not port.Eval(context)[0] <= self._timing.cloud_lost
        return not np.isfinite(self._scalar(context, "cloud_time"))

    def _cloud_message(self, context: Context) -> str:
        """What is known of why there is no cloud, as a sentence."""
        port = self._ports["cloud_fault"]
        fault = DepthFault(int(port.Eval(context)[0])) if port.HasValue(context) else None
        if not fault:
            return "the depth camera gave no image of the scene"
        return FAULT_SENTENCES[fault]

    def _look(self, context: Context, progress: ReachState, time: float) -> ReachState:
        timing = self._timing
        if self._scalar(context, "goal_valid") < 0.5:
            if time - progress.since > timing.goal_timeout:
                return progress.fail(
                    time,
                    "goal_not_seen",
                    f"no marker of the goal object was seen in {timing.goal_timeout:g} s",
                )
            return progress
        if np.isnan(progress.goal_seen_since):
            return replace(progress, goal_seen_since=time)
        if time - progress.goal_seen_since < timing.looking:
            return progress
        if self._is_cloud_old(context):
            if time - progress.goal_seen_since > timing.goal_timeout:
                return progress.fail(time, "cloud_missing", self._cloud_message(context))
            return progress
        return self._choose_place(context, progress, time)

    def _seen(self, context: Context) -> dict[str, Any]:
        """What the planner needs to know, as its arguments."""
        return {
            "base_pose": self._ports["base_pose"].Eval(context),
            "joint_position": self._ports["joint_position"].Eval(context),
            "X_WO": self._ports["object_pose"].Eval(context),
            "cloud_W": cloud_points(self._ports["cloud"].Eval(context)),
        }

    def _choose_place(self, context: Context, progress: ReachState, time: float) -> ReachState:
        plan = self._planner.plan_base_placement(**self._seen(context))
        if plan.status != PlanStatus.CLEAR:
            return progress.fail(time, plan.status.value, plan.message)
        x, y, yaw = plan.base_pose
        driving = progress.to(ReachMode.DRIVING, time)
        return replace(
            driving,
            base_goal=(x, y, yaw),
            places=progress.places + 1,
            planned=plan.movement,
            plan=None,
        )

    def _drive(self, context: Context, progress: ReachState, time: float) -> ReachState:
        if self._scalar(context, "arrived") > 0.5 and time - progress.since > self._time_step:
            return progress.to(ReachMode.SETTLING, time)
        if time - progress.since > self._timing.driving_timeout:
            return progress.fail(time, "drive_failed", "the base did not get to where it can reach")
        return progress

    def _settle(self, context: Context, progress: ReachState, time: float) -> ReachState:
        """Plans while the robot settles, and confirms the plan with the last look."""
        timing, settled = self._timing, time - progress.since
        is_over = settled >= timing.settling - 0.5 * self._time_step
        is_first = settled >= 0.5 * timing.settling and not progress.checked >= progress.since
        if not (is_over or is_first):
            return progress
        begin = perf_counter()
        seen = self._seen(context)
        if progress.plan is not None:
            if not is_over:
                return progress
            if self._is_confirmed(progress, seen):
                starting = progress.to(ReachMode.REACHING, time)
                waited = perf_counter() - begin
                return replace(starting, movements=1, begun=time, planning_seconds=waited)
        plan = self._planner.check_reach(**seen, movement=progress.planned)
        progress = replace(progress, planning_seconds=perf_counter() - begin, checked=time)
        if plan.status == PlanStatus.CLEAR:
            planned_cloud, X_WO = cKDTree(seen["cloud_W"]), RigidTransform(seen["X_WO"])
            return replace(progress, plan=plan, planned_cloud=planned_cloud, X_WO=X_WO)
        if not is_over:
            return replace(progress, plan=None)  # From near more is to be seen.
        if progress.places < timing.places:
            return self._choose_place(context, progress, time)
        return progress.fail(time, plan.status.value, plan.message)

    def _is_confirmed(self, progress: ReachState, seen: dict[str, Any]) -> bool:
        """Whether what is seen now agrees with a plan."""
        plan = progress.plan
        assert plan is not None
        if plan.joint_path is None or not plan.collision_checked:
            return True
        moved = progress.X_WO.translation() - seen["X_WO"].translation()
        same_goal = float(np.linalg.norm(moved)) <= self._timing.goal_moved
        return same_goal and self._reaction.is_free(plan, seen)

    def _hand_distance(self, context: Context, name: str) -> float:
        """Distance of the hand to the point in T at an input port [m]."""
        p_TH = self._ports["hand_pose"].Eval(context).translation()
        return float(np.linalg.norm(self._ports[name].Eval(context) - p_TH))

    def _look_ahead(self, context: Context, progress: ReachState, time: float) -> ReachState:
        """Holds a new cloud against the rest of the movement; see `ReachReplanner`."""
        cloud_time = self._scalar(context, "cloud_time")
        plan, commands = progress.plan, self._ports["arm_position_command"]
        if plan is None or plan.joint_path is None or cloud_time == progress.cloud_time:
            return progress
        progress = replace(progress, cloud_time=cloud_time)
        if not (plan.collision_checked and commands.HasValue(context)):
            return progress
        seen = self._seen(context)
        seen["joint_position"] = seen["joint_position"].copy()
        seen["joint_position"][self._planner.arm_in_body] = commands.Eval(context)
        predicted_points = self._coming(context, seen["X_WO"].translation())
        velocity = self._ports["arm_velocity_command"].Eval(context)
        return self._reaction(progress, Observation(seen, predicted_points, velocity, time))

    def _coming(self, context: Context, goal: Vector) -> Vector:
        """Where what moves near the goal will be soon (P, 3) [m]."""
        port = self._ports["approaching"]
        if not port.HasValue(context):
            return np.zeros((0, 3))
        points = cloud_points(port.Eval(context))
        return points[np.sum((points - goal) ** 2, axis=1) < _NEAR**2]

    def _reach(self, context: Context, progress: ReachState, time: float) -> ReachState:
        progress = self._look_ahead(context, progress, time)
        timing = self._timing
        if progress.suspended_plan is not None:
            if time - progress.begun > timing.blocked_timeout:
                return progress.fail(
                    time, "no_clear_path", "something came in the way and has not gone"
                )
            return progress
        elapsed = time - progress.since
        tau = self._scalar(context, "tau")
        error = self._hand_distance(context, "goal_position")
        behind = 0.0
        if self._ports["desired_position"].HasValue(context):
            behind = self._hand_distance(context, "desired_position")
        if behind > timing.following_error:
            return progress.fail(
                time,
                "cannot_follow",
                f"the hand fell {1000 * behind:.0f} mm behind its movement",
            )
        if elapsed >= tau and error <= timing.position_tolerance:
            if np.isnan(progress.still_since):
                return replace(progress, still_since=time)
            if time - progress.still_since >= 0.2:
                return progress.to(ReachMode.HOLDING, time)
            return progress
        if elapsed > timing.reaching_timeout * tau:
            if error <= timing.accepted_position:
                return progress.to(ReachMode.HOLDING, time)
            return progress.fail(
                time,
                "not_reached",
                f"the hand stayed {1000 * error:.0f} mm from its goal",
            )
        if not np.isnan(progress.still_since):
            return replace(progress, still_since=np.nan)
        return progress

    def _hold(self, context: Context, progress: ReachState, time: float) -> ReachState:
        moved = self._look_ahead(context, progress, time)
        if moved.movements > progress.movements:
            return moved.to(ReachMode.REACHING, time)
        progress = moved
        if time - progress.since >= self._timing.holding:
            return progress.to(ReachMode.DONE, time)
        return progress

    def _calc_movement(self, context: Context, output: Value) -> None:
        progress = self.progress(context)
        running = progress.mode in (ReachMode.REACHING, ReachMode.HOLDING, ReachMode.DONE)
        movement = progress.movement or self._planner.demonstrated
        output.set_value(movement.numbered(progress.movements if running else 0))

    def _calc_base_goal(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(np.array(self.progress(context).base_goal))

    def _calc_resting_head(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(head_search_pattern(context.get_time()))

    def _calc_mode(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, float(self.progress(context).mode))

    def _calc_progress(self, context: Context, output: Value) -> None:
        output.set_value(self.progress(context))


def head_search_pattern(time: float) -> Vector:
    """Where the head looks while the goal is searched for.

    Args:
        time: Since the search began [s].

    Returns:
        Head yaw and pitch (2,) [rad]: first ahead at the height of tables, then sweeping to the
        left and right, by turns at that height and above it.
    """
    blocked_timeout, sweep, period = 1.5, np.radians(60), 6.0
    pitches = (0.25, -0.1)  # Tables, then what is higher.
    swept = max(time - blocked_timeout, 0.0)
    pitch = pitches[int(swept / period) % len(pitches)]
    return np.array([sweep * np.sin(2 * np.pi * swept / period), pitch])
