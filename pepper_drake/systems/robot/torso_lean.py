"""Leans the torso at the hip once the base has arrived."""

from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, EventStatus

from pepper_drake.models.pepper import JOINT_GROUPS
from pepper_drake.systems.framework import LeafSystem
from pepper_drake.systems.robot.base_position_controller import BaseMotion, step_base_reference


@dataclass(unsafe_hash=True)
class LeanMotion:
    """Speed and acceleration of the hip while the torso leans."""

    speed: float = 0.25
    """Largest speed [rad/s]: the head, 0.5 m above the hip, moves at 0.13 m/s."""
    acceleration: float = 0.5
    """Acceleration, braking too [rad/s²]."""
    tolerance: float = 0.005
    """Angle to the goal at which the hip has arrived [rad]."""


class TorsoLean(LeafSystem):
    """Commands hip and knee: they stay where they are until a hip angle is wanted.

    The hip moves while the base stands at its goal, and brakes on a stop.

    .. pydrake_system::

        name: TorsoLean
        input_ports:
        - hip_pitch_goal (optional)
        - base_arrived
        - stop (optional)
        output_ports:
        - body_command
        - hip_velocity
        - arrived

    Inputs: `hip_pitch_goal` (1) [rad], not finite for "stay"; `base_arrived` (1), not zero when the
    base stands at its goal; `stop` (1), not zero: brake, and stay until it is zero again.
    Outputs: `body_command` (3) of `JOINT_GROUPS["body"]` [rad]; `hip_velocity` (1), of that command
    [rad/s]; `arrived` (1), 1 when base and hip have arrived.
    State: hip angle and its velocity (2) [rad, rad/s], every `time_step`.

    Args:
        start: Position of each joint by name at the start [rad].
        motion: Speed and acceleration.
        time_step: Period [s].
    """

    def __init__(
        self, start: dict[str, float], motion: LeanMotion | None = None, *, time_step: float = 0.02
    ) -> None:
        super().__init__()
        motion = LeanMotion() if motion is None else motion
        self._tolerance = motion.tolerance
        self._motion = BaseMotion(
            turning_speed=motion.speed, turning_acceleration=motion.acceleration
        )
        self._time_step = time_step
        self._resting = np.array([start[name] for name in JOINT_GROUPS["body"]])
        self._hip = JOINT_GROUPS["body"].index("HipPitch")
        self._goal = self.DeclareVectorInputPort("hip_pitch_goal", 1)
        self._base_arrived = self.DeclareVectorInputPort("base_arrived", 1)
        self._stop = self.DeclareVectorInputPort("stop", 1)
        self._state = self.DeclareDiscreteState([self._resting[self._hip], 0.0])
        state = {self.discrete_state_ticket(self._state)}
        self.DeclareVectorOutputPort(
            "body_command", 3, self._calc_command, prerequisites_of_calc=state
        )
        self.DeclareVectorOutputPort(
            "hip_velocity", 1, self._calc_velocity, prerequisites_of_calc=state
        )
        self.DeclareVectorOutputPort(
            "arrived",
            1,
            self._calc_arrived,
            prerequisites_of_calc=state | {self._goal.ticket(), self._base_arrived.ticket()},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _wanted(self, context: Context) -> float:
        """Returns the goal [rad], NaN for none."""
        return float(self._goal.Eval(context)[0]) if self._goal.HasValue(context) else np.nan

    def _update(self, context: Context, discrete_state: DiscreteValues) -> EventStatus:
        angle, speed = context.get_discrete_state(self._state).value()
        goal = self._wanted(context)
        stops = self._stop.HasValue(context) and self._stop.Eval(context)[0] != 0.0
        if stops or self._base_arrived.Eval(context)[0] == 0.0:
            goal = np.nan
        if speed == 0.0 and not np.isfinite(goal):
            return EventStatus.DidNothing()
        # A base that only turns has the same law.
        pose, velocity = step_base_reference(
            np.array([0.0, 0.0, angle]),
            np.array([0.0, 0.0, speed]),
            np.array([0.0, 0.0, goal]),
            self._motion,
            self._time_step,
        )
        discrete_state.set_value(self._state, [pose[2], velocity[2]])
        return EventStatus.Succeeded()

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        command = self._resting.copy()
        command[self._hip] = context.get_discrete_state(self._state).value()[0]
        output.SetFromVector(command)

    def _calc_velocity(self, context: Context, output: BasicVector) -> None:
        output.SetAtIndex(0, context.get_discrete_state(self._state).value()[1])

    def _calc_arrived(self, context: Context, output: BasicVector) -> None:
        angle, speed = context.get_discrete_state(self._state).value()
        goal = self._wanted(context)
        leans = np.isfinite(goal) and abs(goal - angle) > self._tolerance
        arrived = self._base_arrived.Eval(context)[0] != 0.0 and not leans and abs(speed) < 0.01
        output.SetAtIndex(0, float(arrived))
