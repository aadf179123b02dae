"""The arm's differential inverse kinematics, compiled and solved exactly; see `compiled_tick`."""

import numpy as np
import numpy.typing as npt

from pepper_drake.compiled import load_compiled
from pepper_drake.models.control_model import CommandLimits, ControlModel, arm_joints
from pepper_drake.planning.collision.compiled_arm import ArmChain
from pepper_drake.planning.ik.compiled_tick import IkNumbers, ik_velocity, track_path
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams, arm_joint_limits

Vector = npt.NDArray[np.float64]


class CompiledIk:
    """Joint velocities that take a hand to a pose, the same as from Drake's system.

    Args:
        model: Pepper.
        chain: Kinematic chain of the arm.
        arm: "left" or "right".
        params: Weights and limits.
    """

    def __init__(
        self, model: ControlModel, chain: ArmChain, arm: str, params: DifferentialIkParams
    ) -> None:
        self._chain = chain
        load_compiled(ik_velocity, track_path)
        limits = arm_joint_limits(model, arm, params)
        rows = model.position_indices(arm_joints(arm))
        self._time_step = params.time_step
        self._numbers = IkNumbers(
            params.position_weight,
            params.orientation_weight,
            params.posture_gain,
            params.tracking_gain / params.time_step,
            params.limit_margin,
            params.limit_influence,
            np.repeat([params.angular_velocity_limit, params.linear_velocity_limit], 3),
            limits.position_lower()[rows],
            limits.position_upper()[rows],
            limits.velocity_lower()[rows],
            limits.velocity_upper()[rows],
        )

    def velocity(
        self, joints: Vector, nominal: Vector, position: Vector, rotation: Vector
    ) -> Vector:
        """Returns joint velocities (5,) [rad/s].

        Args:
            joints: Present joints (5,) [rad].
            nominal: Nominal posture (5,) [rad].
            position: Desired position of the hand (3,), p_TH [m]; see `feedforward_pose`.
            rotation: Desired orientation (4,), unit quaternion w, x, y, z.
        """
        # Copies: read-only or non-contiguous arrays would trigger another compilation.
        found: Vector = ik_velocity(
            np.array(joints),
            np.array(nominal),
            np.array(position),
            np.array(rotation),
            self._chain,
            self._numbers,
        )
        return found

    def track(
        self,
        start: tuple[Vector, Vector],
        nominal: Vector,
        positions: Vector,
        rotations: Vector,
        *,
        limits: CommandLimits,
        ends: int,
        goal: Vector,
        tolerance: float,
        still_speed: float,
    ) -> Vector:
        """Returns joint commands (N + 1, 5) [rad] of N ticks of `velocity` and the command limits.

        Args:
            start: Command of the joints (5,) [rad] and its velocity (5,) [rad/s].
            nominal: Nominal posture at each tick (N, 5) [rad].
            positions: Desired positions of the hand (N, 3) [m].
            rotations: Desired orientations (N, 4).
            limits: Limits of the joint commands.
            ends: First tick at which the commands may end, once the arm is at rest near its goal.
            goal: Goal of the hand (3,) [m].
            tolerance: Distance to the goal that counts as near [m].
            still_speed: Joint speed below which the arm counts as at rest [rad/s].
        """
        commands: Vector = track_path(
            np.array(start[0]),
            np.array(start[1]),
            np.array(nominal, order="C"),
            np.array(positions, order="C"),
            np.array(rotations, order="C"),
            self._chain,
            self._numbers,
            limits.arrays,
            self._time_step,
            ends,
            np.array(goal),
            tolerance,
            still_speed,
        )
        return commands
