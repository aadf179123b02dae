"""Supervises a reach: a LeafSystem around `reach_state_machine.step`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.perception import PointCloud
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DependencyTicket,
    EventStatus,
    InputPort,
    State,
)

from pepper_drake.learning import MovementPrimitive
from pepper_drake.models.control_model import BODY_JOINTS, arm_joints, body_indices
from pepper_drake.perception.mapping.cloud_points import cloud_points
from pepper_drake.perception.mapping.depth_validity import DepthFault
from pepper_drake.perception.mapping.seen_space import SeenSpace
from pepper_drake.perception.mapping.voxel_map import VoxelMap
from pepper_drake.planning.reach.kinematic_simulation import ArmState
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.observation import Observation
from pepper_drake.planning.reach.reach_mode import ReachCommand
from pepper_drake.planning.reach.reach_parameters import ReachTiming
from pepper_drake.planning.reach.reach_plan import Planner
from pepper_drake.planning.reach.reach_state import ReachState, apply_command
from pepper_drake.planning.reach.reach_state_machine import step
from pepper_drake.planning.safety.command_check import StopReason
from pepper_drake.systems.framework import LeafSystem, ValueProducer

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class _Shared:
    """A cached planner, shared by clones of a context, as it has no state."""

    planner: Planner

    def __deepcopy__(self, memo: dict) -> _Shared:
        return self


class ReachSupervisor(LeafSystem):
    """Decides what Pepper does next: look, drive, reach, hold, or stop and report why.

    .. pydrake_system::

        name: ReachSupervisor
        input_ports:
        - object_pose
        - goal_valid
        - goal_age
        - goal_position
        - image_ages (optional)
        - search_delay (optional)
        - cloud
        - cloud_time
        - cloud_fault (optional)
        - predicted_cloud (optional)
        - space (optional)
        - joint_position
        - base_pose
        - hand_pose
        - desired_position (optional)
        - arm_position_command (optional)
        - arm_velocity_command (optional)
        - head_position_command (optional)
        - arrived
        - tau
        - stop_reason
        - stop_joint (optional)
        - base_blocked (optional)
        - predicted_clearance (optional)
        - command (optional)
        - primitive (optional)
        output_ports:
        - movement
        - started
        - base_goal
        - hip_pitch_goal
        - mode
        - movement_origin
        - look_at
        - speed
        - progress

    Inputs: `object_pose` X_WO; `goal_valid` (1), `goal_age` (1) [s]; `goal_position` (3), the
    hand's goal in T [m]; `image_ages` (2) of the top and the bottom camera's newest images [s];
    `search_delay` (1), for which the search for the goal has waited for images [s];
    `cloud` (PointCloud in W) and `cloud_time` (1), capture time of its last image [s], not finite
    before the first; `cloud_fault` (1), a `DepthFault`; `predicted_cloud` (PointCloud in W),
    predicted positions of moving obstacles; `space`, abstract SeenSpace, the observed free and
    occupied space, without it all space counts as known; `joint_position` (15) [rad]; `base_pose`
    (3) [m, rad]; `hand_pose` X_TH and `desired_position` (3), the primitive's desired hand position
    in T [m]; `arm_position_command` and `arm_velocity_command` (5) [rad, rad/s], the measured
    position and zero if unconnected; `head_position_command` (2) [rad]; `arrived` (1); `tau` (1)
    [s]; `stop_reason` (1), the safety monitor's `StopReason`, and `stop_joint` (1), the index of
    the joint that caused it or -1; `base_blocked` (1), whether an obstacle blocks the base;
    `predicted_clearance` (1), clearance to predicted obstacles that the arm's motion approaches
    [m]; `command` (1), a `ReachCommand`, REACH if unconnected; `primitive`, abstract
    MovementPrimitive that replaces the planner's own, or a Movement, whose X_OG replaces the goal
    as well.
    Outputs: `movement`, abstract Movement: the running one, with its number, or with number 0 the
    next one or that of a braking arm; `started` (1), whether the arm reaches or has reached;
    `base_goal` (3) [m, rad] and `hip_pitch_goal` (1) [rad], NaN for "stay"; `mode` (1), a
    `ReachMode`; `movement_origin` (1), the `Origin` of the performed movement; `look_at` (3), a
    point in W for the head to look at [m], NaN for none; `speed` (1), speed scale of the movement;
    `progress`, the whole `ReachState`.
    State: `ReachState` (abstract), every `timing.time_step`.
    """

    def __init__(
        self,
        planner: Planner,
        timing: ReachTiming,
        *,
        arm: str,
        planner_for: Callable[[MovementPrimitive | Movement], Planner] | None = None,
    ) -> None:
        """Makes the system.

        Args:
            planner: Finds plans.
            timing: Durations, timeouts and latencies.
            arm: "left" or "right", the arm that reaches.
            planner_for: Makes the planner for a primitive at the input `primitive`.
        """
        super().__init__()
        self._planner, self._timing = planner, timing
        self._arm_in_body = body_indices(arm_joints(arm))
        self._ports: dict[str, InputPort] = {
            name: self.DeclareAbstractInputPort(name, value)
            for name, value in (
                ("object_pose", Value(RigidTransform())),
                ("cloud", Value(PointCloud())),
                ("predicted_cloud", Value(PointCloud())),
                ("hand_pose", Value(RigidTransform())),
                ("space", Value[object](SeenSpace(VoxelMap.empty()))),
            )
        }
        for name, size in (
            ("goal_valid", 1),
            ("goal_age", 1),
            ("goal_position", 3),
            ("cloud_time", 1),
            ("cloud_fault", 1),
            ("image_ages", 2),
            ("search_delay", 1),
            ("joint_position", len(BODY_JOINTS)),
            ("base_pose", 3),
            ("desired_position", 3),
            ("arm_position_command", 5),
            ("arm_velocity_command", 5),
            ("head_position_command", 2),
            ("arrived", 1),
            ("tau", 1),
            ("stop_reason", 1),
            ("stop_joint", 1),
            ("base_blocked", 1),
            ("predicted_clearance", 1),
            ("command", 1),
        ):
            self._ports[name] = self.DeclareVectorInputPort(name, size)
        self._planner_for = planner_for
        primitive = planner.demonstrated.primitive
        self._ports["primitive"] = self.DeclareAbstractInputPort(
            "primitive", Value[object](primitive)
        )
        self._planner_entry = self.DeclareCacheEntry(
            "planner for the primitive",
            ValueProducer(
                allocate=lambda: Value[object](_Shared(planner)), calc=self._calc_planner
            ),
            prerequisites_of_calc={self._ports["primitive"].ticket()},
        )
        self._state = self.DeclareAbstractState(Value[object](ReachState()))
        state = {self.abstract_state_ticket(self._state)}
        self._declare_output("started", 1, lambda now: [now.has_started], state)
        self._declare_output("base_goal", 3, lambda now: now.base_goal, state)
        self._declare_output("hip_pitch_goal", 1, lambda now: [now.hip_pitch_goal], state)
        self._declare_output("mode", 1, lambda now: [now.mode], state)
        self._declare_output("movement_origin", 1, lambda now: [now.performed_origin], state)
        self._declare_output("look_at", 3, lambda now: now.look_at, state)
        self._declare_output("speed", 1, lambda now: [now.speed], state)
        self.DeclareAbstractOutputPort(
            "progress",
            lambda: Value[object](ReachState()),
            lambda context, out: out.set_value(self.progress(context)),
            prerequisites_of_calc=state,
        )
        self.DeclareAbstractOutputPort(
            "movement",
            lambda: Value[object](planner.demonstrated),
            self._calc_movement,
            prerequisites_of_calc=state | {self._planner_entry.ticket()},
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(timing.time_step, 0.0, self._update)

    def _declare_output(
        self,
        name: str,
        size: int,
        part: Callable[[ReachState], Any],
        tickets: set[DependencyTicket],
    ) -> None:
        """Declares an output computed from the state."""

        def calc(context: Context, output: BasicVector) -> None:
            output.SetFromVector(np.asarray(part(self.progress(context)), dtype=float))

        self.DeclareVectorOutputPort(name, size, calc, prerequisites_of_calc=tickets)

    def progress(self, context: Context) -> ReachState:
        """Returns the present state in a context."""
        return context.get_abstract_state(int(self._state)).get_value()

    def planner(self, context: Context) -> Planner:
        """Returns the planner for the present primitive."""
        planner: Planner = self._planner_entry.Eval(context).planner
        return planner

    def observe(self, context: Context) -> Observation:
        """Returns an observation made from the input ports."""
        ports = self._ports

        def value(name: str) -> Any:
            return ports[name].Eval(context)

        def scalar(name: str) -> float:
            return float(value(name)[0])

        def vector(name: str) -> Vector:
            return np.array(value(name))

        def optional(name: str) -> Vector | None:
            return vector(name) if ports[name].HasValue(context) else None

        # Copies: the state keeps observations, and port values change in place.
        X_WO, joints = RigidTransform(value("object_pose")), np.array(value("joint_position"))
        measured = joints[self._arm_in_body]
        position, velocity = optional("arm_position_command"), optional("arm_velocity_command")
        predicted = np.zeros((0, 3))
        if ports["predicted_cloud"].HasValue(context):
            predicted = cloud_points(value("predicted_cloud"))
        reach = self._planner.params.new_obstacle.max_goal_distance
        near = np.sum((predicted - X_WO.translation()) ** 2, axis=1) < reach**2
        fault = 0.0
        if ports["cloud_fault"].HasValue(context):
            fault = scalar("cloud_fault")
        return Observation(
            time=context.get_time(),
            base_pose=vector("base_pose"),
            joint_position=joints,
            arm=ArmState(
                measured if position is None else position,
                np.zeros(5) if velocity is None else velocity,
            ),
            X_WO=X_WO,
            cloud=cloud_points(value("cloud")),
            predicted_cloud=predicted[near],
            cloud_time=scalar("cloud_time"),
            cloud_fault=DepthFault(int(fault)),
            space=value("space") if ports["space"].HasValue(context) else None,
            goal_valid=scalar("goal_valid") > 0.5,
            goal_age=scalar("goal_age"),
            goal_position=vector("goal_position"),
            image_ages=vector("image_ages")
            if ports["image_ages"].HasValue(context)
            else np.zeros(2),
            search_delay=scalar("search_delay") if ports["search_delay"].HasValue(context) else 0.0,
            hand_position=np.array(value("hand_pose").translation()),
            measured_arm=measured,
            head_command=optional("head_position_command"),
            desired_position=optional("desired_position"),
            base_arrived=scalar("arrived") > 0.5,
            tau=scalar("tau"),
            stop_reason=StopReason(int(scalar("stop_reason"))),
            stop_joint=self._stop_joint(context),
            base_blocked=ports["base_blocked"].HasValue(context) and scalar("base_blocked") > 0.5,
            predicted_clearance=(
                scalar("predicted_clearance")
                if ports["predicted_clearance"].HasValue(context)
                else np.inf
            ),
        )

    def _stop_joint(self, context: Context) -> str:
        """Returns the name of the joint that caused a stop, "" for none."""
        port = self._ports["stop_joint"]
        joint = int(port.Eval(context)[0]) if port.HasValue(context) else -1
        return BODY_JOINTS[joint] if joint >= 0 else ""

    def _calc_planner(self, context: Context, output: Value) -> None:
        primitive, planner = self._ports["primitive"], self._planner
        if self._planner_for is not None and primitive.HasValue(context):
            planner = self._planner_for(primitive.Eval(context))
        output.set_value(_Shared(planner))

    def _calc_movement(self, context: Context, output: Value) -> None:
        state = self.progress(context)
        movement = state.movement or self.planner(context).demonstrated
        output.set_value(movement.numbered(state.active_movement))

    def _update(self, context: Context, state: State) -> EventStatus:
        before = after = self.progress(context)
        command = self._ports["command"]
        if command.HasValue(context):
            wanted = ReachCommand(int(command.Eval(context)[0]))
            after = apply_command(before, wanted, context.get_time())
        planner = self.planner(context)
        after = step(after, self.observe(context), planner, self._timing)
        if after is before:
            return EventStatus.DidNothing()
        state.get_mutable_abstract_state(int(self._state)).set_value(after)
        return EventStatus.Succeeded()
