"""The arm's differential inverse kinematics, compiled and solved exactly; see `compiled_tick`."""

import numpy as np
import numpy.typing as npt

from pepper_drake.models.control_model import CommandLimits, ControlModel, arm_joints
from pepper_drake.planning.collision.compiled_arm import ArmChain
from pepper_drake.planning.ik.compiled_tick import IkNumbers, ik_velocity, track_path
from pepper_drake.planning.ik.differential_ik import DifferentialIkParams, arm_joint_limits

Vector = npt.NDArray[np.float64]


class CompiledIk:
    """Joint velocities of one arm that take its hand to a pose, as Drake's system gives them.

    Args:
        model: Pepper.
        chain: Of the arm.
        arm: "left" or "right".
        params: Weights and limits.
    """

    def __init__(
        self, model: ControlModel, chain: ArmChain, arm: str, params: DifferentialIkParams
    ) -> None:
        self._chain = chain
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
        """Joint velocities (5,) [rad/s].

        Args:
            joints: (5,) present [rad].
            nominal: (5,) nominal posture [rad].
            position: (3,) asked of the hand, p_TH [m]; see `feedforward_pose`.
            rotation: (4,) likewise, unit quaternion w, x, y, z.
        """
        # Copies: compiled anew it would be for arrays that may not be written or have gaps.
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
        """Joint commands (N + 1, 5) [rad] of N ticks, each by `velocity` and the joints' limits.

        Args:
            start: Command of the joints (5,) [rad] and its velocity (5,) [rad/s].
            nominal: (N, 5) nominal posture at each tick [rad].
            positions: (N, 3) asked of the hand [m].
            rotations: (N, 4) likewise.
            limits: Of the joints' commands.
            ends: Tick from which on the commands end when the arm stands near its goal.
            goal: (3,) of the hand [m].
            tolerance: Distance that is near [m].
            still_speed: Joint speed below which the arm stands [rad/s].
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
