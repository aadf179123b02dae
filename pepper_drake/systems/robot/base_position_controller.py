"""Drives Pepper's base to a goal pose on the floor."""

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort

from pepper_drake.systems.framework import LeafSystem

Vector = npt.NDArray[np.float64]


@dataclass(unsafe_hash=True)
class BaseMotion:
    """Speed and acceleration limits, and gains, of the base."""

    speed: float = 0.35
    """Largest speed [m/s]."""
    turning_speed: float = 1.0
    """Largest yaw rate [rad/s]."""
    acceleration: float = 0.3
    """Acceleration along the floor, braking too [m/s²]."""
    turning_acceleration: float = 0.75
    """Acceleration of the yaw rate [rad/s²]."""
    approach_rate: float = 4.0
    """Rate of the exponential approach to the goal [1/s]."""
    correction: float = 1.0
    """Feedback gain on the tracking error [1/s]. Low enough compared with the base's own
    controller that the two cannot oscillate."""
    lag: float = 0.04
    """Normal lag of the base behind its reference [s]: two control periods. Correcting for it
    would cause overshoot."""
    position_tolerance: float = 0.003
    """Distance to the goal at which the base has arrived [m]."""
    yaw_tolerance: float = 0.005
    """Angle to the goal at which the base has arrived [rad]."""
    held_distance: float = 0.04
    """Tracking error at which the base counts as held by an obstacle [m]."""
    held_angle: float = 0.08
    """The same for its yaw [rad]."""
    standing_share: float = 0.5
    """Share of the feedback's largest velocity that the base may have once the arm has started:
    the hand, 0.6 m from it, then moves at 50 mm/s."""
    has_reference: bool = True
    """True if the base follows a reference with limited acceleration. A robot that limits its
    acceleration itself gets the speed from which it would brake at the goal."""


def wrap_angle(angle: float) -> float:
    """Returns the same angle in (-pi, pi]."""
    return float(-((np.pi - angle) % (2 * np.pi) - np.pi))


def approach_speed(distance: float, limit: float, acceleration: float, rate: float) -> float:
    """Returns the speed at a distance from the goal from which braking ends at the goal.

    It is `rate` times the distance near the goal and sqrt(2 a (d - a / (2 rate^2))) beyond
    a / rate^2, so that speed and deceleration are continuous and the latter is at most a.

    Args:
        distance: Distance d to the goal, zero or more [m or rad].
        limit: Largest speed [m/s or rad/s].
        acceleration: Largest deceleration a [m/s^2 or rad/s^2].
        rate: Rate of the exponential approach [1/s].
    """
    near = acceleration / rate**2
    if distance <= near:
        return min(limit, rate * distance)
    return min(limit, math.sqrt(2.0 * acceleration * (distance - 0.5 * near)))


def step_base_reference(
    pose: Vector, velocity: Vector, goal: Vector, motion: BaseMotion, time_step: float
) -> tuple[Vector, Vector]:
    """Moves the base's reference by one step towards its goal.

    It moves in a straight line, with limited acceleration when it starts, changes goal or brakes.

    Args:
        pose: The reference: x, y [m], yaw [rad] in W.
        velocity: Its velocity in W (3,) [m/s, m/s, rad/s].
        goal: The goal, like `pose`; not finite to brake.
        motion: Limits of speed and acceleration.
        time_step: Period [s].

    Returns:
        Pose and velocity one step later.
    """
    desired = np.zeros(3)
    if np.all(np.isfinite(goal)):
        displacement = goal[:2] - pose[:2]
        distance = float(np.hypot(*displacement))
        speed = approach_speed(distance, motion.speed, motion.acceleration, motion.approach_rate)
        desired[:2] = displacement / max(distance, 1e-9) * min(speed, distance / time_step)
        turn = wrap_angle(float(goal[2] - pose[2]))
        turning = approach_speed(
            abs(turn), motion.turning_speed, motion.turning_acceleration, motion.approach_rate
        )
        desired[2] = math.copysign(min(turning, abs(turn) / time_step), turn)
    change = desired - velocity
    max_change = motion.acceleration * time_step
    change[:2] *= min(1.0, max_change / max(float(np.hypot(*change[:2])), 1e-12))
    max_change = motion.turning_acceleration * time_step
    change[2] = min(max(float(change[2]), -max_change), max_change)
    after = velocity + change
    return pose + time_step * after, after


def approach_velocity(pose: Vector, goal: Vector, motion: BaseMotion) -> Vector:
    """Returns the velocity (3,) in B [m/s, rad/s] from which the base would brake at its goal.

    Args:
        pose: Pose of the base: x, y [m], yaw [rad] in W.
        goal: The goal, like `pose`; not finite to brake.
        motion: Limits of speed and acceleration.
    """
    if not np.all(np.isfinite(goal)):
        return np.zeros(3)
    displacement, turn = goal[:2] - pose[:2], wrap_angle(float(goal[2] - pose[2]))
    distance = float(np.hypot(*displacement))
    if distance <= motion.position_tolerance and abs(turn) <= motion.yaw_tolerance:
        return np.zeros(3)
    speed = approach_speed(distance, motion.speed, motion.acceleration, motion.approach_rate)
    turning = approach_speed(
        abs(turn), motion.turning_speed, motion.turning_acceleration, motion.approach_rate
    )
    vx, vy = displacement / max(distance, 1e-9) * speed
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return np.array([cos * vx + sin * vy, cos * vy - sin * vx, math.copysign(turning, turn)])


class BasePositionController(LeafSystem):
    """Drives the base to `base_goal` and reports when it has arrived.

    `step_base_reference` moves a reference with a profile that brakes in time; the base follows it
    by velocity feed-forward and feedback of the tracking error. As the base's own controller lags,
    feedback of the measured pose alone would overshoot. The reference is optional
    (`BaseMotion.has_reference`).

    .. pydrake_system::

        name: BasePositionController
        input_ports:
        - base_goal
        - base_pose
        - stop (optional)
        output_ports:
        - base_velocity_command
        - arrived
        - held

    Inputs: `base_goal` and `base_pose` (3), x and y in m and yaw in rad, in W. A goal that is not
    finite means: brake and stay. `stop` (1), not zero: brake, and stay until it is zero again.
    Outputs: `base_velocity_command` (3), m/s, m/s, rad/s in the base frame B; `arrived` (1), 1 when
    the base stands within the tolerances; `held` (1), 1 when the tracking error is larger than
    unobstructed motion explains.
    State: the reference's pose and velocity in W, the command, and whether the reference is known
    (10), at `time_step`.

    Args:
        motion: Limits and gains; Pepper's if omitted.
        time_step: Period of the update [s].
    """

    def __init__(self, motion: BaseMotion | None = None, *, time_step: float = 0.02) -> None:
        super().__init__()
        self._motion = motion = BaseMotion() if motion is None else motion
        self._time_step = time_step
        self._tolerances = np.array(
            [motion.position_tolerance, motion.position_tolerance, motion.yaw_tolerance]
        )
        self.base_goal_input: InputPort = self.DeclareVectorInputPort("base_goal", 3)
        self.base_pose_input: InputPort = self.DeclareVectorInputPort("base_pose", 3)
        self.stop_input: InputPort = self.DeclareVectorInputPort("stop", 1)
        self._state = self.DeclareDiscreteState(10)
        state = {self.discrete_state_ticket(self._state)}
        self.DeclareVectorOutputPort(
            "base_velocity_command", 3, self._calc_command, prerequisites_of_calc=state
        )
        self.DeclareVectorOutputPort(
            "arrived",
            1,
            self._calc_arrived,
            prerequisites_of_calc=state
            | {self.base_goal_input.ticket(), self.base_pose_input.ticket()},
        )
        self.DeclareVectorOutputPort(
            "held",
            1,
            self._calc_held,
            prerequisites_of_calc=state | {self.base_pose_input.ticket()},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = context.get_discrete_state(self._state).value().copy()
        measured = self.base_pose_input.Eval(context)
        goal = self.base_goal_input.Eval(context)
        if not state[9]:
            state[:3], state[9] = measured, 1.0
        if self.stop_input.HasValue(context) and self.stop_input.Eval(context)[0] != 0.0:
            goal = np.full(3, np.nan)
        if not self._motion.has_reference:
            state[:3], state[6:9] = measured, approach_velocity(measured, goal, self._motion)
            discrete_state.set_value(self._state, state)
            return
        state[:3], state[3:6] = step_base_reference(
            state[:3], state[3:6], goal, self._motion, self._time_step
        )
        error = self._tracking_error(state, measured)
        if not state[3:6].any() and not np.all(np.isfinite(goal)):
            # Without a goal the reference follows the base, even if it is pushed.
            state[:3], error = measured, np.zeros(3)
        v_W = state[3:6] + self._motion.correction * error
        cos, sin = math.cos(measured[2]), math.sin(measured[2])
        state[6:9] = cos * v_W[0] + sin * v_W[1], cos * v_W[1] - sin * v_W[0], v_W[2]
        discrete_state.set_value(self._state, state)

    def _tracking_error(self, state: Vector, measured: Vector) -> Vector:
        """Returns the tracking error with the normal lag taken into account (3,), in W."""
        error = state[:3] - self._motion.lag * state[3:6] - measured
        error[2] = wrap_angle(float(error[2]))
        return error

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._state).value()[6:9])

    def _calc_arrived(self, context: Context, output: BasicVector) -> None:
        error = self.base_goal_input.Eval(context) - self.base_pose_input.Eval(context)
        error[2] = wrap_angle(error[2])
        velocity = context.get_discrete_state(self._state).value()[6:9]
        has_arrived = np.all(np.abs(error) <= self._tolerances) and np.all(np.abs(velocity) < 0.01)
        output.SetAtIndex(0, float(has_arrived))

    def _calc_held(self, context: Context, output: BasicVector) -> None:
        state = context.get_discrete_state(self._state).value()
        held = 0.0
        if state[9] and self._motion.has_reference:
            error = self._tracking_error(state, self.base_pose_input.Eval(context))
            far = math.hypot(*error[:2]) > self._motion.held_distance
            held = float(far or abs(error[2]) > self._motion.held_angle)
        output.SetAtIndex(0, held)
