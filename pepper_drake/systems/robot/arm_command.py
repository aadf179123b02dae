"""The arm's joint command: what the inverse kinematics asks for, inside every limit."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import Context, DiscreteValues, InputPort

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.ik.command_limits import limit_joint_command
from pepper_drake.systems.framework import LeafSystem

Vector = npt.NDArray[np.float64]

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
        self._position = self.DeclareDiscreteState(self._step(np.array(start_position), _REST)[0])
        self._velocity = self.DeclareDiscreteState(5)
        self.DeclareStateOutputPort("position_command", self._position)
        self.DeclareStateOutputPort("velocity_command", self._velocity)
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _initialize(self, context: Context, discrete_state: DiscreteValues) -> None:
        position, _ = self._step(self.measured_position_input.Eval(context), _REST)
        discrete_state.set_value(self._position, position)
        discrete_state.set_value(self._velocity, _REST)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        active = self.active_input.Eval(context)[0] > 0.5
        velocity = context.get_discrete_state(self._velocity).value()
        if not (active or velocity.any()):
            return
        position, velocity = self._step(
            context.get_discrete_state(self._position).value(),
            velocity,
            self.desired_velocity_input.Eval(context) if active else _REST,
        )
        discrete_state.set_value(self._position, position)
        discrete_state.set_value(self._velocity, velocity)

    def _step(
        self, position: Vector, velocity: Vector, desired_velocity: Vector = _REST
    ) -> tuple[Vector, Vector]:
        return limit_joint_command(
            position,
            velocity,
            desired_velocity,
            limits=self._limits,
            time_step=self._time_step,
        )
