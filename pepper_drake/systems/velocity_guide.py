"""A hand guide that is driven by velocities: keys, a game pad, sliders."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.common.eigen_geometry import AngleAxis, Quaternion
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.framework import Context, DiscreteValues, LeafSystem

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GuideLeash:
    """How far the guide may be from the hand: as far as a hold on it lasts."""

    distance: float = 0.06
    """[m]."""
    angle: float = 0.8
    """[rad]."""


def step_guide(
    X_TG: RigidTransform,
    velocity: Vector,
    X_TH: RigidTransform,
    time_step: float,
    leash: GuideLeash,
) -> RigidTransform:
    """Moves a guide by one step and keeps it on its leash about the hand.

    Args:
        X_TG: The guide's pose.
        velocity: (6,) angular and linear velocity in the axes of T [rad/s, m/s].
        X_TH: The hand's pose.
        time_step: [s].
        leash: How far it may be from the hand.
    """
    position = X_TG.translation() + time_step * velocity[3:]
    rotation = _turn(time_step * velocity[:3]) @ X_TG.rotation()
    offset = position - X_TH.translation()
    distance = float(np.linalg.norm(offset))
    if distance > leash.distance:
        position = X_TH.translation() + offset * (leash.distance / distance)
    turn = (rotation @ X_TH.rotation().inverse()).ToAngleAxis()
    if abs(turn.angle()) > leash.angle:
        angle = np.copysign(leash.angle, turn.angle())
        rotation = RotationMatrix(AngleAxis(angle, turn.axis())) @ X_TH.rotation()
    return RigidTransform(rotation, position)


def _turn(vector: Vector) -> RotationMatrix:
    angle = float(np.linalg.norm(vector))
    return RotationMatrix(AngleAxis(angle, vector / angle)) if angle > 0.0 else RotationMatrix()


class VelocityGuide(LeafSystem):
    """Moves a guide pose with a commanded velocity, on a leash about the hand.

    .. pydrake_system::

        name: VelocityGuide
        input_ports:
        - velocity_command
        - hand_pose
        - torso_pose
        output_ports:
        - guide_pose
        - guide_velocity

    Inputs: `velocity_command` (6) angular and linear velocity in the axes of T [rad/s, m/s];
    `hand_pose` X_TH and `torso_pose` X_WT (RigidTransform). Outputs: `guide_pose` X_WG
    (RigidTransform), `guide_velocity` V_WG (SpatialVelocity), as HandGuide takes them.

    State: position and quaternion w, x, y, z of the guide in T and the velocity (13), discrete
    with period `time_step`. Until its first step the guide is at the hand, at rest.
    """

    def __init__(self, leash: GuideLeash | None = None, time_step: float = 0.01) -> None:
        """Makes the guide.

        Args:
            leash: How far it may be from the hand.
            time_step: [s].
        """
        super().__init__()
        self._leash, self._time_step = leash or GuideLeash(), time_step
        self.velocity_input = self.DeclareVectorInputPort("velocity_command", 6)
        self.hand_pose_input = self.DeclareAbstractInputPort("hand_pose", Value(RigidTransform()))
        self.torso_pose_input = self.DeclareAbstractInputPort("torso_pose", Value(RigidTransform()))
        # A quaternion of zeros says that the guide has not moved yet.
        self._state = self.DeclareDiscreteState(13)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)
        state = self.discrete_state_ticket(self._state)
        self.guide_pose_output = self.DeclareAbstractOutputPort(
            "guide_pose",
            lambda: Value(RigidTransform()),
            self._calc_pose,
            {state, self.hand_pose_input.ticket(), self.torso_pose_input.ticket()},
        )
        self.guide_velocity_output = self.DeclareAbstractOutputPort(
            "guide_velocity",
            lambda: Value(SpatialVelocity()),
            self._calc_velocity,
            {state, self.torso_pose_input.ticket()},
        )

    def _pose(self, context: Context) -> RigidTransform:
        """X_TG."""
        values = context.get_discrete_state(self._state).value()
        if not values[3:7].any():
            return RigidTransform(self.hand_pose_input.Eval(context))
        return RigidTransform(RotationMatrix(Quaternion(values[3:7])), values[:3])

    def _update(self, context: Context, state: DiscreteValues) -> None:
        before = self._pose(context)
        X_TG = step_guide(
            before,
            self.velocity_input.Eval(context),
            self.hand_pose_input.Eval(context),
            self._time_step,
            self._leash,
        )
        # On a taut leash the guide is slower than its command.
        turn = (X_TG.rotation() @ before.rotation().inverse()).ToAngleAxis()
        shift = X_TG.translation() - before.translation()
        velocity = np.concatenate((turn.angle() * turn.axis(), shift)) / self._time_step
        quaternion = X_TG.rotation().ToQuaternion().wxyz()
        state.set_value(self._state, np.concatenate((X_TG.translation(), quaternion, velocity)))

    def _calc_pose(self, context: Context, output: Value) -> None:
        output.set_value(self.torso_pose_input.Eval(context) @ self._pose(context))

    def _calc_velocity(self, context: Context, output: Value) -> None:
        velocity = context.get_discrete_state(self._state).value()[7:]
        R_WT = self.torso_pose_input.Eval(context).rotation()
        output.set_value(SpatialVelocity(w=R_WT @ velocity[:3], v=R_WT @ velocity[3:]))
