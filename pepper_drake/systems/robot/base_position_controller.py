"""Drives Pepper's base to a place on the floor."""

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort

from pepper_drake.systems.framework import LeafSystem

Vector = npt.NDArray[np.float64]


def wrap_angle(angle: float) -> float:
    """The same angle in (-pi, pi]."""
    return float(-((np.pi - angle) % (2 * np.pi) - np.pi))


def base_velocity(
    base_pose: Vector,
    goal: Vector,
    previous: Vector,
    *,
    speed: float,
    turning_speed: float,
    acceleration: float,
    turning_acceleration: float,
    approach_rate: float,
    time_step: float,
) -> Vector:
    """Velocity that brings the omnidirectional base to its goal along a straight line.

    The speed is that from which the base can still brake at `acceleration`, sqrt(2 a d) at a
    distance d (less one period's travel), up to `speed`; over the last centimetres it is
    `approach_rate` d, so that the base settles and does not rock. It changes by no more than
    `acceleration`.

    Args:
        base_pose: x, y (m), yaw (rad) in W.
        goal: The same.
        previous: The velocity of the last period (3,), in the base frame B.
        speed: m/s.
        turning_speed: rad/s.
        acceleration: m/s^2.
        turning_acceleration: rad/s^2.
        approach_rate: 1/s.
        time_step: s.

    Returns:
        vx, vy (m/s) and yaw rate (rad/s), in the base frame B.
    """
    p_W = goal[:2] - base_pose[:2]
    distance = float(np.hypot(*p_W))
    turn = wrap_angle(goal[2] - base_pose[2])

    def brake(remaining: float, limit: float, rate: float) -> float:
        slowest = rate * time_step
        return min(limit, np.sqrt(slowest**2 / 4 + 2 * rate * remaining) - slowest / 2)

    v_W = (
        p_W
        / max(distance, 1e-9)
        * min(brake(distance, speed, acceleration), approach_rate * distance)
    )
    yaw = base_pose[2]
    wish = np.array(
        [
            np.cos(yaw) * v_W[0] + np.sin(yaw) * v_W[1],
            -np.sin(yaw) * v_W[0] + np.cos(yaw) * v_W[1],
            np.sign(turn)
            * min(brake(abs(turn), turning_speed, turning_acceleration), approach_rate * abs(turn)),
        ]
    )
    change = wish - previous
    change[:2] *= min(1.0, acceleration * time_step / max(float(np.hypot(*change[:2])), 1e-12))
    change[2] = np.clip(
        change[2], -turning_acceleration * time_step, turning_acceleration * time_step
    )
    return previous + change


class BasePositionController(LeafSystem):
    """Drives the base to `base_goal` and says when it stands there.

    .. pydrake_system::

        name: BasePositionController
        input_ports:
        - base_goal
        - base_pose
        output_ports:
        - base_velocity_command
        - arrived

    Inputs: `base_goal` and `base_pose` (3), x and y in m and yaw in rad, in W. A goal that is not
    finite means: stay. Outputs: `base_velocity_command` (3), m/s, m/s, rad/s in the base frame B;
    `arrived` (1), 1 when the base stands within the tolerances. State: the velocity (3), at
    `time_step`.
    """

    def __init__(
        self,
        *,
        time_step: float = 0.02,
        speed: float = 0.35,
        turning_speed: float = 1.0,
        acceleration: float = 0.3,
        turning_acceleration: float = 0.75,
        approach_rate: float = 5.0,
        position_tolerance: float = 0.003,
        yaw_tolerance: float = 0.005,
    ) -> None:
        super().__init__()
        self._motion = {
            "speed": speed,
            "turning_speed": turning_speed,
            "acceleration": acceleration,
            "turning_acceleration": turning_acceleration,
            "approach_rate": approach_rate,
            "time_step": time_step,
        }
        self._tolerances = np.array([position_tolerance, position_tolerance, yaw_tolerance])
        self.base_goal_input: InputPort = self.DeclareVectorInputPort("base_goal", 3)
        self.base_pose_input: InputPort = self.DeclareVectorInputPort("base_pose", 3)
        self._velocity = self.DeclareDiscreteState(3)
        state = {self.discrete_state_ticket(self._velocity)}
        self.DeclareStateOutputPort("base_velocity_command", self._velocity)
        self.DeclareVectorOutputPort(
            "arrived",
            1,
            self._calc_arrived,
            prerequisites_of_calc=state
            | {self.base_goal_input.ticket(), self.base_pose_input.ticket()},
        )
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        base_pose = self.base_pose_input.Eval(context)
        goal = self.base_goal_input.Eval(context)
        previous = context.get_discrete_state(self._velocity).value()
        if not np.all(np.isfinite(goal)):
            goal = base_pose
        discrete_state.set_value(
            self._velocity, base_velocity(base_pose, goal, previous, **self._motion)
        )

    def _calc_arrived(self, context: Context, output: BasicVector) -> None:
        goal = self.base_goal_input.Eval(context)
        error = goal - self.base_pose_input.Eval(context)
        error[2] = wrap_angle(error[2])
        velocity = context.get_discrete_state(self._velocity).value()
        there = np.all(np.abs(error) <= self._tolerances) and np.all(np.abs(velocity) < 0.01)
        output.SetAtIndex(0, float(there))
