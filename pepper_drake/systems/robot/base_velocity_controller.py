"""The base's own velocity controller, with odometry."""

import math
from collections.abc import Sequence

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort

from pepper_drake.systems.framework import LeafSystem


class BaseVelocityController(LeafSystem):
    """Integrates a velocity command in the base frame into the base's desired pose and velocity.

    .. pydrake_system::

        name: BaseVelocityController
        input_ports:
        - base_velocity_command (optional)
        - base_pose
        output_ports:
        - desired_state

    Inputs: `base_velocity_command` (3) in B [m/s, m/s, rad/s], zero if unconnected; `base_pose`
    (3), x, y, yaw in W, read at initialization [m, rad].
    Output: `desired_state` (6), x, y, yaw and their rates in W.
    State: x, y, yaw, rates, whether the initial pose is known, and the velocity in B (10), at
    `time_step`. In an uninitialized context the base stands at `start_pose` (x, y, yaw).

    It limits the base's commands: each velocity in B is clipped to the rated speed, and changes by
    no more than the rated acceleration allows; a command that is not finite brakes.

    Args:
        start_pose: x, y, yaw (3,) in W [m, rad].
        time_step: Period of the update [s].
        speed: Largest speed along each axis of B [m/s].
        turning_speed: Largest yaw rate [rad/s].
        acceleration: Largest acceleration along each axis of B [m/s^2].
        turning_acceleration: Largest yaw acceleration [rad/s^2].
    """

    def __init__(
        self,
        start_pose: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        time_step: float = 0.01,
        speed: float = 0.55,
        turning_speed: float = 2.0,
        acceleration: float = 1.0,
        turning_acceleration: float = 3.0,
    ) -> None:
        super().__init__()
        self._time_step = time_step
        self._limit = np.array([speed, speed, turning_speed])
        rates = np.array([acceleration, acceleration, turning_acceleration])
        self._change = time_step * rates
        self.velocity_input: InputPort = self.DeclareVectorInputPort("base_velocity_command", 3)
        self.base_pose_input: InputPort = self.DeclareVectorInputPort("base_pose", 3)
        self._state = self.DeclareDiscreteState([*start_pose, *np.zeros(7)])
        self.DeclareVectorOutputPort(
            "desired_state",
            6,
            self._calc_desired_state,
            prerequisites_of_calc={self.discrete_state_ticket(self._state)},
        )
        self.DeclareInitializationDiscreteUpdateEvent(self._initialize)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _initialize(self, context: Context, discrete_state: DiscreteValues) -> None:
        pose = self.base_pose_input.Eval(context)
        discrete_state.set_value(
            self._state, np.concatenate((pose, np.zeros(3), [1.0], np.zeros(3)))
        )

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = context.get_discrete_state(self._state).value()
        if state[6] == 0:
            self._initialize(context, discrete_state)
            return
        command = np.zeros(3)
        if self.velocity_input.HasValue(context):
            command = self.velocity_input.Eval(context)
        if not (state[7:].any() or command.any()):
            return  # It stands and shall stand: the state stays as it is.
        if not np.all(np.isfinite(command)):
            command = np.zeros(3)
        v_B, change = state[7:], self._change
        v_B = np.clip(np.clip(command, -self._limit, self._limit), v_B - change, v_B + change)
        vx, vy, turning = v_B.tolist()
        # Heading of the chord of the arc driven in one period.
        heading = float(state[2]) + turning * self._time_step / 2
        cos, sin = math.cos(heading), math.sin(heading)
        rates = np.array([cos * vx - sin * vy, sin * vx + cos * vy, turning])
        discrete_state.set_value(
            self._state, np.concatenate((state[:3] + self._time_step * rates, rates, [1.0], v_B))
        )

    def _calc_desired_state(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._state).value()[:6])
