"""The arm's joint command: what the inverse kinematics asks for, inside every limit."""

from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import Context, DiscreteValues, InputPort, LeafSystem

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.ik.command_limits import clamp_to_position_limits, limit_joint_command

_REST = np.zeros(5)


class ArmCommand(LeafSystem):
    """Integrates the inverse kinematics' joint velocities into commands that keep all limits.

    While inactive the command brakes to a stand and stays. It starts from the measured position
    when the diagram is initialized, so that nothing jumps; in a context that never was, from
    `start_position`.

    .. pydrake_system::

        name: ArmCommand
        input_ports:
        - active
        - desired_velocity
        - measured_position
        output_ports:
        - position_command
        - velocity_command

    Inputs: `active` (1), 0 or 1; `desired_velocity` (5) [rad/s]; `measured_position` (5) [rad].
    Outputs: `position_command` (5) [rad]; `velocity_command` (5) [rad/s].
    State: command position (5) and velocity (5), at `time_step`; at rest it does not change.
    The law is `planning.ik.command_limits.limit_joint_command`.
    """

    def __init__(
        self,
        *,
        limits: CommandLimits,
        start_position: Sequence[float],
        time_step: float = 0.01,
    ) -> None:
        super().__init__()
        self._limits, self._time_step = limits, time_step
        self.active_input: InputPort = self.DeclareVectorInputPort("active", 1)
        self.desired_velocity_input: InputPort = self.DeclareVectorInputPort("desired_velocity", 5)
        self.measured_position_input: InputPort = self.DeclareVectorInputPort(
            "measured_position", 5
        )
        start = clamp_to_position_limits(np.array(start_position), limits)
        self._position = self.DeclareDiscreteState(start)
        self._velocity = self.DeclareDiscreteState(5)
        self.DeclareStateOutputPort("position_command", self._position)
        self.DeclareStateOutputPort("velocity_command", self._velocity)
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _initialize(self, context: Context, discrete_state: DiscreteValues) -> None:
        measured = self.measured_position_input.Eval(context)
        position = clamp_to_position_limits(measured, self._limits)
        discrete_state.set_value(self._position, position)
        discrete_state.set_value(self._velocity, _REST)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        active = self.active_input.Eval(context)[0] > 0.5
        velocity = context.get_discrete_state(self._velocity).value()
        if not (active or velocity.any()):
            return
        position, velocity = limit_joint_command(
            context.get_discrete_state(self._position).value(),
            velocity,
            self.desired_velocity_input.Eval(context) if active else _REST,
            limits=self._limits,
            time_step=self._time_step,
        )
        discrete_state.set_value(self._position, position)
        discrete_state.set_value(self._velocity, velocity)
