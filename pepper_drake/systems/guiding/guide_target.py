"""Velocity of a hand guide: towards the pose set by sliders, or as commanded by a game pad."""

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, InputPort, OutputPort

from pepper_drake.systems.framework import LeafSystem

Vector = npt.NDArray[np.float64]


def velocity_to(
    X_TG: RigidTransform,
    X_TGd: RigidTransform,
    *,
    time_constant: float,
    max_speed: float,
    max_turn_rate: float,
) -> Vector:
    """Returns the velocity (6,), angular and linear in T, that moves a guide to its target.

    It is the error divided by the time constant, limited in magnitude.

    Args:
        X_TG: The guide's pose.
        X_TGd: Its target.
        time_constant: [s].
        max_speed: [m/s].
        max_turn_rate: [rad/s].
    """
    turn = (X_TGd.rotation() @ X_TG.rotation().inverse()).ToAngleAxis()
    rate = np.clip(turn.angle() / time_constant, -max_turn_rate, max_turn_rate)
    linear = (X_TGd.translation() - X_TG.translation()) / time_constant
    linear *= min(1.0, max_speed / max(float(np.linalg.norm(linear)), 1e-12))
    return np.concatenate((rate * turn.axis(), linear))


class GuideTarget(LeafSystem):
    """Steers a VelocityGuide to a target pose.

    .. pydrake_system::

        name: GuideTarget
        input_ports:
        - target_pose
        - guide_pose
        - torso_pose
        - velocity_command (optional)
        output_ports:
        - velocity_command

    Inputs: `target_pose`, the desired X_TG, `guide_pose` X_WG and `torso_pose` X_WT
    (RigidTransform); `velocity_command` (6), a game pad's: unless zero, it is passed through and
    the target is ignored. Output: `velocity_command` (6), angular and linear in the axes of T
    [rad/s, m/s]. No state.

    Args:
        time_constant: [s].
        max_speed: [m/s].
        max_turn_rate: [rad/s].
    """

    def __init__(
        self, *, time_constant: float = 0.15, max_speed: float = 0.35, max_turn_rate: float = 1.5
    ) -> None:
        super().__init__()
        self._time_constant = time_constant
        self._max_speed, self._max_turn_rate = max_speed, max_turn_rate
        pose = Value(RigidTransform())
        self.target_pose_input: InputPort = self.DeclareAbstractInputPort("target_pose", pose)
        self.guide_pose_input: InputPort = self.DeclareAbstractInputPort("guide_pose", pose)
        self.torso_pose_input: InputPort = self.DeclareAbstractInputPort("torso_pose", pose)
        self.velocity_input: InputPort = self.DeclareVectorInputPort("velocity_command", 6)
        self.velocity_output: OutputPort = self.DeclareVectorOutputPort(
            "velocity_command",
            6,
            self._calc_velocity,
            {
                port.ticket()
                for port in (
                    self.target_pose_input,
                    self.guide_pose_input,
                    self.torso_pose_input,
                    self.velocity_input,
                )
            },
        )

    def _calc_velocity(self, context: Context, output: BasicVector) -> None:
        if self.velocity_input.HasValue(context):
            velocity = self.velocity_input.Eval(context)
            if np.any(velocity):
                output.SetFromVector(velocity)
                return
        X_WT = self.torso_pose_input.Eval(context)
        output.SetFromVector(
            velocity_to(
                X_WT.InvertAndCompose(self.guide_pose_input.Eval(context)),
                self.target_pose_input.Eval(context),
                time_constant=self._time_constant,
                max_speed=self._max_speed,
                max_turn_rate=self._max_turn_rate,
            )
        )
