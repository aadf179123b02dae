"""The last system before the robot: only safe commands pass."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    EventStatus,
    InputPort,
    State,
)

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.safety.command_check import StopReason, check_command
from pepper_drake.planning.safety.contact_detection import ContactParams
from pepper_drake.planning.safety.safe_command import SafeCommand, SafeCommandLayout, slowed
from pepper_drake.systems.framework import LeafSystem, ValueProducer

_NOT_MEASURED = (
    StopReason.JOINTS_NOT_MEASURED,
    StopReason.BASE_NOT_MEASURED,
    StopReason.GOAL_NOT_FINITE,
)


class SafetyMonitor(LeafSystem):
    """Passes joint commands within all limits; stops the robot if necessary, with a reason.

    A stop is latched. The joints brake within their acceleration limits and stay; after a joint
    failed to follow its command, all return to their positions of a moment before. A stop is caused
    by an invalid command (`planning.safety.command_check.check_command`), by a link that moves
    closer to an obstacle than `minimum_clearance`, by a joint that does not follow
    (`planning.safety.contact_detection`), by a base that is held, by missing measurements, and by
    `stop_request`.

    .. pydrake_system::

        name: SafetyMonitor
        input_ports:
        - joint_position_command
        - joint_position
        - clearance (optional)
        - body_clearance (optional)
        - measurement_age (optional)
        - goal_gap (optional)
        - missing_joint (optional)
        - base_held (optional)
        - stop_request (optional)
        - reset (optional)
        - limp (optional)
        output_ports:
        - safe_joint_position_command
        - stop_reason
        - stop_joint

    Inputs: `joint_position_command` and `joint_position`, measured (n) [rad]; `clearance` (1),
    that of the arm if its own motion reduces it, and `body_clearance` (1), that of the rest of the
    robot [m]; `measurement_age` (2), time since joints and base were last measured, and `goal_gap`
    (1), since the goal's estimate was last finite [s]; `missing_joint` (1), the index of the joint
    without a measurement; `base_held` (1), 0 or 1; `stop_request` (1), 0 or 1; `reset` (1), a
    number: when it changes, the stop is reset at the next tick and commands continue from the
    measured positions; `limp` (1), 1 while joints are moved by hand: commands, which then follow
    the joints, are not checked.
    Outputs: `safe_joint_position_command` (n) [rad]; `stop_reason` (1), a `StopReason`;
    `stop_joint` (1), the index of the joint that caused it, or -1.
    State: a `SafeCommand` as numbers (`SafeCommandLayout`) and the last `reset`, at `time_step`. It
    starts from the measured position at initialization; in an uninitialized context from the first
    command within the limits.

    Args:
        limits: Limits of the joints.
        start_position: Positions before that (n,) [rad].
        minimum_clearance: Distance of a link to an obstacle at which the robot stops [m].
        contact: Detection of a joint that does not follow; None for joints that may be moved by
            hand.
        longest_gap: Longest tolerated gap in measurements and estimates [s].
        catch_time: Time for joints that were moved by hand to come to rest [s].
        time_step: Control period [s].
    """

    def __init__(
        self,
        *,
        limits: CommandLimits,
        start_position: npt.ArrayLike,
        minimum_clearance: float = 0.0,
        contact: ContactParams | None = None,
        longest_gap: float = 0.12,
        catch_time: float = 0.5,
        time_step: float = 0.01,
    ) -> None:
        super().__init__()
        n = len(limits.velocity)
        self._limits, self._time_step = limits, time_step
        self._contact = contact
        self._limits_back = limits if contact is None else slowed(limits, contact.back_off_speed)
        self._minimum_clearance, self._longest_gap = minimum_clearance, longest_gap
        self._catch_time = catch_time
        self.command_input: InputPort = self.DeclareVectorInputPort("joint_position_command", n)
        self.measured_input: InputPort = self.DeclareVectorInputPort("joint_position", n)
        self.clearance_input: InputPort = self.DeclareVectorInputPort("clearance", 1)
        self.body_clearance_input: InputPort = self.DeclareVectorInputPort("body_clearance", 1)
        self.measurement_age_input: InputPort = self.DeclareVectorInputPort("measurement_age", 2)
        self.goal_gap_input: InputPort = self.DeclareVectorInputPort("goal_gap", 1)
        self.missing_joint_input: InputPort = self.DeclareVectorInputPort("missing_joint", 1)
        self.base_held_input: InputPort = self.DeclareVectorInputPort("base_held", 1)
        self.stop_request_input: InputPort = self.DeclareVectorInputPort("stop_request", 1)
        self.reset_input: InputPort = self.DeclareVectorInputPort("reset", 1)
        self.limp_input: InputPort = self.DeclareVectorInputPort("limp", 1)
        start = replace(SafeCommand.at_rest(np.asarray(start_position, dtype=float)), known=False)
        self._layout = SafeCommandLayout.of(n, contact, time_step)
        self._state = self.DeclareDiscreteState(self._layout.to_vector(start))
        self._resets = self.DeclareDiscreteState(1)
        state = self.discrete_state_ticket(self._state)
        # The measured position is read only at ticks: it changes with every step of the plant.
        self._next = self.DeclareCacheEntry(
            "command of the present tick",
            ValueProducer(allocate=lambda: Value[object](start), calc=self._calc_next),
            prerequisites_of_calc={
                state,
                self.command_input.ticket(),
                self.clearance_input.ticket(),
                self.body_clearance_input.ticket(),
                self.measurement_age_input.ticket(),
                self.goal_gap_input.ticket(),
                self.missing_joint_input.ticket(),
                self.base_held_input.ticket(),
                self.stop_request_input.ticket(),
                self.limp_input.ticket(),
            },
        )
        self.DeclareVectorOutputPort(
            "safe_joint_position_command",
            n,
            self._calc_command,
            prerequisites_of_calc={self._next.ticket()},
        )
        self.DeclareVectorOutputPort(
            "stop_reason", 1, self._calc_reason, prerequisites_of_calc={self._next.ticket()}
        )
        self.DeclareVectorOutputPort(
            "stop_joint", 1, self._calc_joint, prerequisites_of_calc={self._next.ticket()}
        )
        # Unrestricted updates come first: a hold of the command gets the measured position.
        self.DeclareInitializationUnrestrictedUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _command(self, context: Context) -> SafeCommand:
        return self._layout.from_vector(context.get_discrete_state(self._state).value())

    def _initialize(self, context: Context, state: State) -> EventStatus:
        measured = self.measured_input.Eval(context)
        if not np.isfinite(measured).all():
            return EventStatus.DidNothing()
        at_rest = SafeCommand.at_rest(measured.copy())
        mine = state.get_mutable_discrete_state(int(self._state))
        mine.SetFromVector(self._layout.to_vector(at_rest))
        return EventStatus.Succeeded()

    def _scalar(self, context: Context, port: InputPort, otherwise: float) -> float:
        """Returns the first value at an optional port."""
        return float(port.Eval(context)[0]) if port.HasValue(context) else otherwise

    def _find_stop_reason(self, context: Context, command: SafeCommand) -> StopReason:
        """Returns the reason why the robot has to stop now, NONE if it need not."""
        if self._scalar(context, self.stop_request_input, 0.0) > 0.5:
            return StopReason.REQUESTED
        ages = [0.0, 0.0]
        if self.measurement_age_input.HasValue(context):
            ages = self.measurement_age_input.Eval(context).tolist()
        ages.append(self._scalar(context, self.goal_gap_input, 0.0))
        for age, reason in zip(ages, _NOT_MEASURED, strict=True):
            if not age <= self._longest_gap:
                return reason
        if not self._scalar(context, self.clearance_input, np.inf) >= self._minimum_clearance:
            return StopReason.LINK_TOO_CLOSE
        if not self._scalar(context, self.body_clearance_input, np.inf) >= self._minimum_clearance:
            return StopReason.BODY_TOO_CLOSE
        if self._scalar(context, self.base_held_input, 0.0) > 0.5:
            return StopReason.BASE_HELD
        if self._scalar(context, self.limp_input, 0.0) > 0.5:
            return StopReason.NONE
        desired = self.command_input.Eval(context)
        previous = desired if command.desired is None else command.desired
        return check_command(desired, previous, self._limits, time_step=self._time_step)

    def _calc_next(self, context: Context, following: Value) -> None:
        command, desired = self._command(context), self.command_input.Eval(context)
        if not command.known:
            first = check_command(desired, desired, self._limits, time_step=self._time_step)
            command = SafeCommand.at_rest(
                command.position if first != StopReason.NONE else desired.copy()
            )
        if command.reason == StopReason.NONE:
            reason = self._find_stop_reason(context, command)
            joint = -1.0
            if reason == StopReason.JOINTS_NOT_MEASURED:
                joint = self._scalar(context, self.missing_joint_input, -1.0)
            if reason != StopReason.NONE:
                command = command.stopped(reason, int(joint))
        limits = self._limits_back if command.reason == StopReason.JOINT_HELD else self._limits
        following.set_value(command.advanced(desired.copy(), limits, self._time_step))

    def _update(self, context: Context, state: DiscreteValues) -> None:
        command, measured = self._next.Eval(context), self.measured_input.Eval(context).copy()
        before = context.get_discrete_state(self._resets).value()[0]
        resets = self._scalar(context, self.reset_input, before)
        state.set_value(self._resets, [resets])
        is_led = self._scalar(context, self.limp_input, 0.0) > 0.5
        if resets != before:
            command = SafeCommand.at_rest(measured, round(self._catch_time / self._time_step))
        elif self._contact is not None and not is_led:
            # A value substituted for a missing measurement must not be taken for a contact.
            stale = self._is_stale(context)
            command = command.compared(None if stale else measured, self._contact, self._time_step)
        state.set_value(self._state, self._layout.to_vector(command))

    def _is_stale(self, context: Context) -> bool:
        """Tells whether the joints were not measured at this tick."""
        port = self.measurement_age_input
        return port.HasValue(context) and not float(port.Eval(context)[0]) <= 0.5 * self._time_step

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._next.Eval(context).position)

    def _calc_reason(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, float(self._next.Eval(context).reason))

    def _calc_joint(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, float(self._next.Eval(context).joint))
