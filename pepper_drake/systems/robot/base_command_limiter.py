"""Last check of the base's velocity commands before the robot."""

import math

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    EventStatus,
    InputPort,
)

from pepper_drake.systems.framework import LeafSystem, ValueProducer
from pepper_drake.systems.robot.base_position_controller import BaseMotion

Vector = npt.NDArray[np.float64]


def largest_base_velocity(
    motion: BaseMotion, before: Vector, time_step: float, *, stands: bool, brakes: bool
) -> Vector:
    """Returns the largest speed [m/s] and yaw rate [rad/s] that a command may ask for (2,).

    A base that drives has the reference's velocity and that of the feedback; one that stands, while
    the arm moves, a share of the feedback's. Both rise at most twice as fast as the reference, as
    the feedback rises, too; a base that brakes becomes as slow as the reference does.

    Args:
        motion: Limits and gain of the base's controller.
        before: Speed and yaw rate of the last command (2,).
        time_step: Period of the commands [s].
        stands: Whether the base has to stand.
        brakes: Whether it has to brake.
    """
    feedback = motion.correction * np.array([motion.held_distance, motion.held_angle])
    change = time_step * np.array([motion.acceleration, motion.turning_acceleration])
    if stands:
        largest = motion.standing_share * feedback
    else:
        largest = np.array([motion.speed, motion.turning_speed]) + feedback
    return np.minimum(largest, np.maximum(before - change, 0.0) if brakes else before + 2 * change)


def limit_base_command(command: Vector, largest: Vector) -> Vector:
    """Returns a command (3,) shortened to the largest velocity; zero if it is not finite.

    Args:
        command: Velocity in B (3,) [m/s, m/s, rad/s].
        largest: Largest speed [m/s] and yaw rate [rad/s] (2,).
    """
    if not np.isfinite(command).all():
        return np.zeros(3)
    vx, vy, turning = command.tolist()
    speed, most = math.hypot(vx, vy), largest.tolist()
    share = 1.0 if speed <= most[0] else most[0] / speed
    return np.array([share * vx, share * vy, min(max(turning, -most[1]), most[1])])


class BaseCommandLimiter(LeafSystem):
    """Keeps the base's commands within its limits, and brakes it on a stop.

    Whatever a faulty controller or link asks for, the base is no faster than a drive needs, holds
    its place at most slowly once the arm has started, and brakes when it has no goal or is stopped.
    Commands within the limits pass unchanged, in the same tick.

    .. pydrake_system::

        name: BaseCommandLimiter
        input_ports:
        - base_velocity_command
        - base_goal
        - started
        - stop
        output_ports:
        - safe_base_velocity_command

    Inputs: `base_velocity_command` (3) in B [m/s, m/s, rad/s]; `base_goal` (3), not finite for
    "brake and stay"; `started` (1), not zero once the arm has started, and the base has to stand;
    `stop` (1), not zero: brake and stay.
    Output: `safe_base_velocity_command` (3), like the input.
    State: speed [m/s] and yaw rate [rad/s] of the last command (2), at `time_step`.

    Args:
        motion: Limits and gain of the base's controller.
        time_step: Period of the commands [s].
    """

    def __init__(self, motion: BaseMotion, *, time_step: float = 0.02) -> None:
        super().__init__()
        self._motion, self._time_step = motion, time_step
        self.command_input: InputPort = self.DeclareVectorInputPort("base_velocity_command", 3)
        self.goal_input: InputPort = self.DeclareVectorInputPort("base_goal", 3)
        self.started_input: InputPort = self.DeclareVectorInputPort("started", 1)
        self.stop_input: InputPort = self.DeclareVectorInputPort("stop", 1)
        self._state = self.DeclareDiscreteState(2)
        self._command = self.DeclareCacheEntry(
            "command of the present tick",
            ValueProducer(allocate=lambda: Value[object](np.zeros(3)), calc=self._calc_next),
            prerequisites_of_calc={
                self.discrete_state_ticket(self._state),
                self.command_input.ticket(),
                self.goal_input.ticket(),
                self.started_input.ticket(),
                self.stop_input.ticket(),
            },
        )
        self.DeclareVectorOutputPort(
            "safe_base_velocity_command",
            3,
            self._calc_command,
            prerequisites_of_calc={self._command.ticket()},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _calc_next(self, context: Context, value: Value) -> None:
        has_goal = np.isfinite(self.goal_input.Eval(context)).all()
        largest = largest_base_velocity(
            self._motion,
            context.get_discrete_state(self._state).value(),
            self._time_step,
            stands=self.started_input.Eval(context)[0] != 0.0,
            brakes=not has_goal or self.stop_input.Eval(context)[0] != 0.0,
        )
        value.set_value(limit_base_command(self.command_input.Eval(context), largest))

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._command.Eval(context))

    def _update(self, context: Context, discrete_state: DiscreteValues) -> EventStatus:
        vx, vy, turning = self._command.Eval(context).tolist()
        speeds = [math.hypot(vx, vy), abs(turning)]
        if np.array_equal(speeds, context.get_discrete_state(self._state).value()):
            return EventStatus.DidNothing()
        discrete_state.set_value(self._state, speeds)
        return EventStatus.Succeeded()
