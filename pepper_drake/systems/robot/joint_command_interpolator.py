"""The joints' servos, which interpolate between commands."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort

from pepper_drake.systems.framework import LeafSystem


class JointCommandInterpolator(LeafSystem):
    """Interpolates between joint position commands, as Pepper's DCM does.

    .. pydrake_system::

        name: JointCommandInterpolator
        input_ports:
        - joint_position_command
        output_ports:
        - desired_state

    Input: `joint_position_command` (n) [rad], new every `command_period`: the desired positions one
    period later.
    Output: `desired_state` (2 n) [rad, rad/s]. With the last command q_1 and the one before, q_0,
    the position is q_0 + (q_1 - q_0) / 2 in the first half of the period and q_1 in the second, the
    velocity always (q_1 - q_0) / `command_period`. At first q_0 is q_1, so that nothing jumps.
    State: q_0 and q_1 (2 n), the latter sampled in the middle of the period, so that it does not
    matter whether a command arrives just before or just after the period begins; the interpolation
    factor; whether there was a command.

    Args:
        size: Number n of joints.
        command_period: [s].
    """

    def __init__(self, size: int, command_period: float) -> None:
        super().__init__()
        self._size, self._period = size, command_period
        self.command_input: InputPort = self.DeclareVectorInputPort("joint_position_command", size)
        self._state = self.DeclareDiscreteState(2 * size + 2)
        self.DeclareVectorOutputPort(
            "desired_state",
            2 * size,
            self._calc_desired_state,
            prerequisites_of_calc={
                self.discrete_state_ticket(self._state),
                self.command_input.ticket(),
            },
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(command_period, 0.0, self._begin)
        self.DeclarePeriodicDiscreteUpdateEvent(command_period, command_period / 2, self._finish)

    def restart(self, context: Context, joints: Sequence[int], positions: npt.ArrayLike) -> None:
        """Resets the last commands of some joints to their present positions.

        For joints that were moved while limp: their next command is near their present position
        and far from the last command.

        Args:
            context: This system's context.
            joints: Indices of the joints.
            positions: Their present positions [rad].
        """
        state = context.get_mutable_discrete_state(self._state).get_mutable_value()
        rows = np.asarray(joints, dtype=int)
        state[rows] = state[self._size + rows] = positions

    def _initialize(self, context: Context, discrete_state: DiscreteValues) -> None:
        command = self.command_input.Eval(context)
        discrete_state.set_value(self._state, np.concatenate((command, command, [0.5, 1.0])))

    def _begin(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = discrete_state.get_mutable_vector(self._state).get_mutable_value()
        state[: self._size] = state[self._size : -2]
        state[-2] = 0.5

    def _finish(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = discrete_state.get_mutable_vector(self._state).get_mutable_value()
        state[self._size : -2] = self.command_input.Eval(context)
        if not state[-1]:
            state[: self._size] = state[self._size : -2]
        state[-2:] = 1.0

    def _calc_desired_state(self, context: Context, output: BasicVector) -> None:
        state = context.get_discrete_state(self._state).value()
        command = self.command_input.Eval(context)
        before = state[: self._size] if state[-1] else command
        change = command - before
        desired = output.get_mutable_value()
        desired[: self._size] = before + float(state[-2]) * change
        desired[self._size :] = change / self._period
