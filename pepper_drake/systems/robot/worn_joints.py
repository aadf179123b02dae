"""Latency and backlash between the command and the joint of a worn robot."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort

from pepper_drake.systems.framework import LeafSystem


class CommandLatency(LeafSystem):
    """Delays commands by a number of control periods.

    Drake's DiscreteTimeDelay outputs zeros at first, which joints would take for a command.

    .. pydrake_system::

        name: CommandLatency
        input_ports:
        - command
        output_ports:
        - delayed_command

    Input and output: (n). State: the queue of commands (steps n), at `time_step`; it is filled with
    the first command at initialization, with `start` in an uninitialized context.

    Args:
        start: A command (n,).
        steps: Number of periods, one or more.
        time_step: The control period [s].
    """

    def __init__(self, start: npt.ArrayLike, steps: int, time_step: float) -> None:
        super().__init__()
        first = np.asarray(start, dtype=float)
        self._size, self._steps = len(first), steps
        self.command_input: InputPort = self.DeclareVectorInputPort("command", len(first))
        self._queue = self.DeclareDiscreteState(np.tile(first, steps))
        self.DeclareVectorOutputPort(
            "delayed_command",
            len(first),
            self._calc,
            prerequisites_of_calc={self.discrete_state_ticket(self._queue)},
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _initialize(self, context: Context, discrete_state: DiscreteValues) -> None:
        command = self.command_input.Eval(context)
        discrete_state.set_value(self._queue, np.tile(command, self._steps))

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        queue = context.get_discrete_state(self._queue).value()
        following = np.concatenate((queue[self._size :], self.command_input.Eval(context)))
        discrete_state.set_value(self._queue, following)

    def _calc(self, context: Context, output: BasicVector) -> None:
        queue = context.get_discrete_state(self._queue).value()
        output.SetFromVector(queue[: self._size])


class JointBacklash(LeafSystem):
    """Slack between motors and joints: the play operator, with its hysteresis.

    A joint stays in place until the motor has crossed the slack, then follows it half the slack
    behind (Nordin and Gutman 2002, doi 10.1016/S0005-1098(02)00047-X).

    .. pydrake_system::

        name: JointBacklash
        input_ports:
        - motor_state
        output_ports:
        - joint_state
        - gap

    Input: `motor_state` (2 n), the desired positions and velocities of the motors [rad, rad/s].
    Outputs: `joint_state` (2 n), those of the joints: with zero velocity while the slack is
    crossed; `gap` (n), the motors' lead over the joints [rad].
    State: the joints' positions (n) and whether they are known, at `time_step`.

    Args:
        backlash: Slack from end to end (n,) [rad].
        time_step: Period at which the positions are stored [s].
        offset: Time of the first update [s].
    """

    def __init__(
        self, backlash: npt.ArrayLike, *, time_step: float = 0.01, offset: float = 0.005
    ) -> None:
        super().__init__()
        self._half = 0.5 * np.asarray(backlash, dtype=float)
        n = self._size = len(self._half)
        self.motor_input: InputPort = self.DeclareVectorInputPort("motor_state", 2 * n)
        self._state = self.DeclareDiscreteState(n + 1)
        ready = {self.discrete_state_ticket(self._state), self.motor_input.ticket()}
        self.DeclareVectorOutputPort(
            "joint_state", 2 * n, self._calc_joints, prerequisites_of_calc=ready
        )
        self.DeclareVectorOutputPort("gap", n, self._calc_gap, prerequisites_of_calc=ready)
        self.DeclareInitializationDiscreteUpdateEvent(self._update)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, offset, self._update)

    def _joints(self, context: Context) -> npt.NDArray[np.float64]:
        """Returns the present positions of the joints (n,)."""
        motors = self.motor_input.Eval(context)[: self._size]
        state = context.get_discrete_state(self._state).value()
        if not state[-1]:
            return np.asarray(motors)
        return np.clip(state[:-1], motors - self._half, motors + self._half)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        discrete_state.set_value(self._state, np.concatenate((self._joints(context), [1.0])))

    def _calc_joints(self, context: Context, output: BasicVector) -> None:
        motors, joints = self.motor_input.Eval(context), self._joints(context)
        lag = motors[: self._size] - joints
        velocity = motors[self._size :]
        # The motor drives the joint only in contact with the side towards which it turns.
        pushes = (np.abs(lag) >= self._half - 1e-9) & (lag * velocity >= 0.0)
        output.SetFromVector(np.concatenate((joints, np.where(pushes, velocity, 0.0))))

    def _calc_gap(self, context: Context, output: BasicVector) -> None:
        motors = self.motor_input.Eval(context)[: self._size]
        output.SetFromVector(motors - self._joints(context))
