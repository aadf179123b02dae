"""The last check before the robot: only commands that it may be given pass."""

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.ik.command_check import StopReason, check_command
from pepper_drake.systems.framework import LeafSystem, ValueProducer


class SafetyMonitor(LeafSystem):
    """Passes joint commands that are safe, else holds the last safe one and says why.

    A stop is latched: from then on the last safe command is held. Stops come from the command
    itself (`planning.command_check.check_command`), from a link closer to an obstacle than
    `minimum_clearance`, and from `stop_request`.

    .. pydrake_system::

        name: SafetyMonitor
        input_ports:
        - joint_position_command
        - joint_position
        - clearance
        - stop_request
        output_ports:
        - safe_joint_position_command
        - stop_reason

    Inputs: `joint_position_command` and `joint_position`, measured (n) [rad]; `clearance` (1), m,
    optional; `stop_request` (1), 0 or 1, optional.
    Outputs: `safe_joint_position_command` (n) [rad]; `stop_reason` (1), a `StopReason`.
    State: the last safe command (n), whether it is known, and the reason (n + 2), at `time_step`.
    Before the first tick the last safe command is the measured position.
    """

    def __init__(
        self,
        *,
        limits: CommandLimits,
        minimum_clearance: float = 0.0,
        time_step: float = 0.01,
    ) -> None:
        super().__init__()
        n = len(limits.velocity)
        self._num_joints = n
        self._limits, self._time_step = limits, time_step
        self._minimum_clearance = minimum_clearance
        self.command_input: InputPort = self.DeclareVectorInputPort("joint_position_command", n)
        self.measured_input: InputPort = self.DeclareVectorInputPort("joint_position", n)
        self.clearance_input: InputPort = self.DeclareVectorInputPort("clearance", 1)
        self.stop_request_input: InputPort = self.DeclareVectorInputPort("stop_request", 1)
        self._state = self.DeclareDiscreteState(n + 2)
        sources = {
            self.discrete_state_ticket(self._state),
            self.command_input.ticket(),
            self.clearance_input.ticket(),
            self.stop_request_input.ticket(),
        }
        self._verdict = self.DeclareCacheEntry(
            "stop reason of the present command",
            ValueProducer(allocate=lambda: Value[object](StopReason.NONE), calc=self._calc_verdict),
            prerequisites_of_calc=sources,
        )
        self.DeclareVectorOutputPort(
            "safe_joint_position_command",
            n,
            self._calc_command,
            prerequisites_of_calc={self._verdict.ticket()},
        )
        self.DeclareVectorOutputPort(
            "stop_reason",
            1,
            self._calc_reason,
            prerequisites_of_calc={self._verdict.ticket()},
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _initialize(self, context: Context, discrete_state: DiscreteValues) -> None:
        measured = self.measured_input.Eval(context)
        discrete_state.set_value(self._state, np.concatenate((measured, [1.0, StopReason.NONE])))

    def _calc_verdict(self, context: Context, status: Value) -> None:
        status.set_value(self._judge(context))

    def _judge(self, context: Context) -> StopReason:
        n = self._num_joints
        state = context.get_discrete_state(self._state).value()
        if state[n + 1]:
            return StopReason(int(state[n + 1]))
        if self.stop_request_input.HasValue(context) and (
            self.stop_request_input.Eval(context)[0] > 0.5
        ):
            return StopReason.REQUESTED
        if self.clearance_input.HasValue(context) and (
            self.clearance_input.Eval(context)[0] < self._minimum_clearance
        ):
            return StopReason.LINK_TOO_CLOSE
        command = self.command_input.Eval(context)
        previous = state[:n] if state[n] else command
        return check_command(command, previous, self._limits, time_step=self._time_step)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        n = self._num_joints
        state = context.get_discrete_state(self._state).value().copy()
        if not state[n]:
            self._initialize(context, discrete_state)
            return
        status = self._verdict.Eval(context)
        if status == StopReason.NONE:
            state[:n] = self.command_input.Eval(context)
        state[n + 1] = status
        discrete_state.set_value(self._state, state)

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        n = self._num_joints
        state = context.get_discrete_state(self._state).value()
        if self._verdict.Eval(context) == StopReason.NONE:
            output.SetFromVector(self.command_input.Eval(context))
        elif state[n]:
            output.SetFromVector(state[:n])
        else:
            output.SetFromVector(self.measured_input.Eval(context))

    def _calc_reason(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, float(self._verdict.Eval(context)))
