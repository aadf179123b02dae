"""Who moves the arm: a guide, a joint path, the movement primitive, or nobody."""

from enum import IntEnum

import numpy as np
from pydrake.systems.framework import BasicVector, Context, InputPort, OutputPort

from pepper_drake.systems.framework import LeafSystem


class ArmMode(IntEnum):
    """Who moves the arm."""

    LIMP = 0
    """A guide; the command follows the measured joints."""
    HELD = 1
    """Nobody: the command stands still."""
    JOINTS = 2
    """It goes to given joint angles."""
    HAND = 3
    """The inverse kinematics, with which the hand follows its movement."""


class ArmModeSwitch(LeafSystem):
    """Chooses the joint velocity that ArmCommand integrates, by the arm's mode.

    .. pydrake_system::

        name: ArmModeSwitch
        input_ports:
        - mode
        - measured_position
        - joint_target
        - position_command
        - hand_velocity
        output_ports:
        - desired_velocity
        - holding
        - active
        - moving

    Inputs: `mode` (1), an ArmMode; `measured_position` and `joint_target` (5), where the arm is and
    where it should go in the mode JOINTS [rad]; `position_command` (5), ArmCommand's [rad];
    `hand_velocity` (5), the inverse kinematics', rad/s, which is evaluated in the mode HAND only.
    Outputs: `desired_velocity` (5) [rad/s]; `holding` (1), 1 while a guide may hold the hand: in
    LIMP; `active` (1), 1 while the primitive runs: in HAND; `moving` (1), 1 while the arm moves by
    itself: in JOINTS and HAND. No state.

    Args:
        time_constant: With which the command follows a joint target [s].
        time_step: Of ArmCommand [s]: with it the command catches up with a limp arm.
    """

    def __init__(self, *, time_constant: float = 0.1, time_step: float = 0.01) -> None:
        super().__init__()
        self._time_constant, self._time_step = time_constant, time_step
        self.mode_input: InputPort = self.DeclareVectorInputPort("mode", 1)
        self._joints: dict[str, InputPort] = {
            name: self.DeclareVectorInputPort(name, 5)
            for name in ("measured_position", "joint_target", "position_command", "hand_velocity")
        }
        mode = self.mode_input.ticket()
        self.desired_velocity_output: OutputPort = self.DeclareVectorOutputPort(
            "desired_velocity",
            5,
            self._calc_velocity,
            {mode, *(port.ticket() for port in self._joints.values())},
        )
        self.holding_output = self._declare_flag("holding", ArmMode.LIMP)
        self.active_output = self._declare_flag("active", ArmMode.HAND)
        self.moving_output = self._declare_flag("moving", ArmMode.JOINTS, ArmMode.HAND)

    def _declare_flag(self, name: str, *modes: ArmMode) -> OutputPort:
        def calc(context: Context, output: BasicVector) -> None:
            output.SetAtIndex(0, float(self._mode(context) in modes))

        return self.DeclareVectorOutputPort(name, 1, calc, {self.mode_input.ticket()})

    def _mode(self, context: Context) -> ArmMode:
        return ArmMode(int(self.mode_input.Eval(context)[0]))

    def _calc_velocity(self, context: Context, output: BasicVector) -> None:
        mode, joints = self._mode(context), self._joints
        if mode == ArmMode.HAND:
            velocity = joints["hand_velocity"].Eval(context)
        elif mode == ArmMode.HELD:
            velocity = np.zeros(5)
        else:
            limp = mode == ArmMode.LIMP
            target = joints["measured_position" if limp else "joint_target"].Eval(context)
            time = 4 * self._time_step if limp else self._time_constant
            velocity = (target - joints["position_command"].Eval(context)) / time
        output.SetFromVector(velocity)
