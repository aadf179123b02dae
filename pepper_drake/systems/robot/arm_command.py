"""The arm's joint command: from the source selected by the arm mode, within all limits."""

from collections.abc import Callable, Sequence
from enum import IntEnum

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort, OutputPort

from pepper_drake.models.control_model import CommandLimits
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams
from pepper_drake.planning.safety.command_limits import (
    clamp_to_position_limits,
    limit_joint_command,
)
from pepper_drake.systems.framework import LeafSystem

Vector = npt.NDArray[np.float64]

_REST = np.zeros(5)


class ArmMode(IntEnum):
    """The source of the arm's motion."""

    LIMP = 0
    """A guide moves the arm; the command follows the measured joints."""
    HELD = 1
    """None: the command is constant."""
    JOINTS = 2
    """A joint target."""
    HAND = 3
    """The inverse kinematics: the hand follows its movement."""


class ArmCommand(LeafSystem):
    """Integrates joint velocities into position commands within all limits.

    The arm mode selects the source of the velocities: in the mode HAND the inverse kinematics while
    a movement runs. Without a source the command brakes and stays. It starts from the measured
    position at initialization, so that nothing jumps; in an uninitialized context from
    `start_position`.

    .. pydrake_system::

        name: ArmCommand
        input_ports:
        - movement
        - desired_velocity
        - measured_position
        - arm_mode (optional)
        - joint_target (optional)
        - stop_reason (optional)
        output_ports:
        - position_command
        - velocity_command
        - active
        - limp

    Inputs: `movement`, abstract Movement; `desired_velocity` (5) of the inverse kinematics [rad/s],
    evaluated while a movement runs only; `measured_position` (5) [rad]; `arm_mode` (1), an ArmMode,
    HAND if unconnected; `joint_target` (5) [rad] of the mode JOINTS; `stop_reason` (1): while it is
    not 0 the robot is stopped, and the command follows the measured position.
    Outputs: `position_command` (5) [rad]; `velocity_command` (5) [rad/s]; `active` (1), 1 while the
    arm moves by itself: in JOINTS, and in HAND during a movement; `limp` (1), 1 in LIMP.
    State: command position (5) and velocity (5), at `time_step`; constant at rest.
    The limits are applied by `planning.safety.command_limits.limit_joint_command`.
    """

    def __init__(
        self,
        *,
        limits: CommandLimits,
        start_position: Sequence[float],
        time_constant: float = DifferentialIkParams.target_time_constant,
        catch_up_steps: int = DifferentialIkParams.catch_up_steps,
        time_step: float = 0.01,
    ) -> None:
        """Makes the system.

        Args:
            limits: Limits of the arm's joints.
            start_position: (5,) [rad].
            time_constant: Time constant of following a joint target [s].
            catch_up_steps: Control periods in which the command catches up with a limp arm.
            time_step: [s].
        """
        super().__init__()
        self._limits = limits
        self._time_constant, self._time_step = time_constant, time_step
        self._catch_up_steps = catch_up_steps
        self.movement_input: InputPort = self.DeclareAbstractInputPort(
            "movement", Value[object](None)
        )
        self.desired_velocity_input: InputPort = self.DeclareVectorInputPort("desired_velocity", 5)
        self.measured_position_input: InputPort = self.DeclareVectorInputPort(
            "measured_position", 5
        )
        self.arm_mode_input: InputPort = self.DeclareVectorInputPort("arm_mode", 1)
        self.joint_target_input: InputPort = self.DeclareVectorInputPort("joint_target", 5)
        self.stop_reason_input: InputPort = self.DeclareVectorInputPort("stop_reason", 1)
        self._position = self.DeclareDiscreteState(
            clamp_to_position_limits(np.array(start_position), limits)
        )
        self._velocity = self.DeclareDiscreteState(5)
        self.DeclareStateOutputPort("position_command", self._position)
        self.DeclareStateOutputPort("velocity_command", self._velocity)
        self._declare_flag("active", self._is_active)
        self._declare_flag("limp", lambda context: self._mode(context) == ArmMode.LIMP)
        self.DeclareInitializationDiscreteUpdateEvent(self._follow)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _declare_flag(self, name: str, calc: Callable[[Context], bool]) -> OutputPort:
        def calc_flag(context: Context, output: BasicVector) -> None:
            output.SetAtIndex(0, float(calc(context)))

        return self.DeclareVectorOutputPort(
            name, 1, calc_flag, {self.arm_mode_input.ticket(), self.movement_input.ticket()}
        )

    def _mode(self, context: Context) -> ArmMode:
        if not self.arm_mode_input.HasValue(context):
            return ArmMode.HAND
        return ArmMode(int(self.arm_mode_input.Eval(context)[0]))

    def _is_active(self, context: Context) -> bool:
        mode = self._mode(context)
        runs = mode == ArmMode.HAND and self.movement_input.Eval(context).runs
        return runs or mode == ArmMode.JOINTS

    def _follow(self, context: Context, discrete_state: DiscreteValues) -> None:
        """Sets the command to the measured position."""
        measured = self.measured_position_input.Eval(context)
        position = clamp_to_position_limits(measured, self._limits)
        discrete_state.set_value(self._position, position)
        discrete_state.set_value(self._velocity, _REST)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        stop_reason = self.stop_reason_input
        if stop_reason.HasValue(context) and stop_reason.Eval(context)[0]:
            self._follow(context, discrete_state)
            return
        velocity = context.get_discrete_state(self._velocity).value()
        position = context.get_discrete_state(self._position).value()
        desired = self._desired_velocity(context, position)
        if desired is _REST and not velocity.any():
            return
        position, velocity = self._step(position, velocity, desired)
        discrete_state.set_value(self._position, position)
        discrete_state.set_value(self._velocity, velocity)

    def _desired_velocity(self, context: Context, position: Vector) -> Vector:
        mode = self._mode(context)
        if mode == ArmMode.LIMP:
            error: Vector = self.measured_position_input.Eval(context) - position
            return error / (self._catch_up_steps * self._time_step)
        if mode == ArmMode.JOINTS:
            remaining: Vector = self.joint_target_input.Eval(context) - position
            return remaining / self._time_constant
        if self._is_active(context):
            desired: Vector = self.desired_velocity_input.Eval(context)
            return desired
        return _REST

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
