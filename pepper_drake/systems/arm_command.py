"""The arm's joint command: what the inverse kinematics asks for, inside every limit."""

from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort, LeafSystem

from pepper_drake.planning.control_model import CommandLimits
from pepper_drake.planning.joint_command import step_arm_command


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

    Inputs: `active` (1), 0 or 1; `desired_velocity` (5), rad/s; `measured_position` (5), rad.
    Outputs: `position_command` (5), rad; `velocity_command` (5), rad/s.
    State: command position and velocity (10), at `time_step`. The law is
    `planning.joint_command.step_arm_command`.
    """

    def __init__(
        self,
        *,
        arm: str,
        limits: CommandLimits,
        start_position: Sequence[float],
        time_step: float = 0.01,
    ) -> None:
        super().__init__()
        self._arm, self._limits, self._time_step = arm, limits, time_step
        self.active_input: InputPort = self.DeclareVectorInputPort("active", 1)
        self.desired_velocity_input: InputPort = self.DeclareVectorInputPort("desired_velocity", 5)
        self.measured_position_input: InputPort = self.DeclareVectorInputPort(
            "measured_position", 5
        )
        self._state = self.DeclareDiscreteState(np.array([*start_position, *np.zeros(5)]))
        state = {self.discrete_state_ticket(self._state)}
        self.DeclareVectorOutputPort(
            "position_command", 5, self._calc_position, prerequisites_of_calc=state
        )
        self.DeclareVectorOutputPort(
            "velocity_command", 5, self._calc_velocity, prerequisites_of_calc=state
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _initialize(self, context: Context, discrete_state: DiscreteValues) -> None:
        measured = self.measured_position_input.Eval(context)
        discrete_state.set_value(self._state, np.concatenate((measured, np.zeros(5))))

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = context.get_discrete_state(self._state).value()
        active = self.active_input.Eval(context)[0] > 0.5
        position, velocity = step_arm_command(
            state[:5],
            state[5:],
            self.desired_velocity_input.Eval(context) if active else np.zeros(5),
            arm=self._arm,
            limits=self._limits,
            time_step=self._time_step,
        )
        discrete_state.set_value(self._state, np.concatenate((position, velocity)))

    def _calc_position(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._state).value()[:5])

    def _calc_velocity(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._state).value()[5:])
