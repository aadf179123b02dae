"""A hand guide driven by velocity commands: keys, a game pad, sliders."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.common.eigen_geometry import AngleAxis, Quaternion
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.framework import BasicVector, Context, DiscreteValues

from pepper_drake.systems.framework import LeafSystem

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class GuideLimits:
    """Largest deviation of the guide from the hand."""

    distance: float = 0.06
    """[m]."""
    angle: float = 0.2
    """[rad]. An arm with five joints cannot hold its hand's orientation everywhere: with a small
    limit the orientation yields to the position."""


def step_guide(
    X_TG: RigidTransform,
    velocity: Vector,
    X_TH: RigidTransform,
    time_step: float,
    leash: GuideLimits,
) -> RigidTransform:
    """Moves a guide by one step and keeps it within its limits around the hand.

    Args:
        X_TG: The guide's pose.
        velocity: (6,) angular and linear velocity in the axes of T [rad/s, m/s].
        X_TH: The hand's pose.
        time_step: [s].
        leash: Largest deviation from the hand.
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
    """Moves a guide pose at a commanded velocity, within limits around the hand.

    .. pydrake_system::

        name: VelocityGuide
        input_ports:
        - velocity_command
        - hand_pose
        - torso_pose
        - holding (optional)
        output_ports:
        - guide_pose
        - guide_velocity
        - guide_position

    Inputs: `velocity_command` (6) angular and linear velocity in the axes of T [rad/s, m/s];
    `hand_pose` X_TH and `torso_pose` X_WT (RigidTransform); `holding` (1): while it is 0 the guide
    stays at the hand. Outputs: `guide_pose` X_WG (RigidTransform), `guide_velocity` V_WG
    (SpatialVelocity), as HandGuide takes them; `guide_position` (3) of the guide in T [m].

    State: position and quaternion w, x, y, z of the guide in W, its velocity in W, and its position
    in T (16), discrete with period `time_step`. Until its first step the guide is at the hand, at
    rest.
    """

    def __init__(self, leash: GuideLimits | None = None, time_step: float = 0.01) -> None:
        """Makes the guide.

        Args:
            leash: Largest deviation from the hand.
            time_step: [s].
        """
        super().__init__()
        self._leash, self._time_step = leash or GuideLimits(), time_step
        self.velocity_input = self.DeclareVectorInputPort("velocity_command", 6)
        self.hand_pose_input = self.DeclareAbstractInputPort("hand_pose", Value(RigidTransform()))
        self.torso_pose_input = self.DeclareAbstractInputPort("torso_pose", Value(RigidTransform()))
        self.holding_input = self.DeclareVectorInputPort("holding", 1)
        # A zero quaternion marks a guide that has not moved yet.
        self._state = self.DeclareDiscreteState(16)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)
        state = self.discrete_state_ticket(self._state)
        inputs = {self.hand_pose_input.ticket(), self.torso_pose_input.ticket()}
        self.guide_pose_output = self.DeclareAbstractOutputPort(
            "guide_pose", lambda: Value(RigidTransform()), self._calc_pose, {state, *inputs}
        )
        self.guide_velocity_output = self.DeclareAbstractOutputPort(
            "guide_velocity", lambda: Value(SpatialVelocity()), self._calc_velocity, {state}
        )
        self.guide_position_output = self.DeclareVectorOutputPort(
            "guide_position", 3, self._calc_position, {state, self.hand_pose_input.ticket()}
        )

    def _values(self, context: Context) -> Vector | None:
        """Returns the state; None until the guide's first step."""
        values: Vector = context.get_discrete_state(self._state).value()
        return values if values[3:7].any() else None

    def _pose(self, context: Context) -> RigidTransform:
        """Returns X_WG: from the state if known, else from the inputs."""
        values = self._values(context)
        if values is None:
            return self.torso_pose_input.Eval(context) @ self.hand_pose_input.Eval(context)
        return RigidTransform(RotationMatrix(Quaternion(values[3:7])), values[:3])

    def _update(self, context: Context, state: DiscreteValues) -> None:
        if self.holding_input.HasValue(context) and not self.holding_input.Eval(context)[0]:
            state.set_value(self._state, np.zeros(16))
            return
        X_WT = self.torso_pose_input.Eval(context)
        before = self._pose(context)
        X_TG = step_guide(
            X_WT.inverse() @ before,
            self.velocity_input.Eval(context),
            self.hand_pose_input.Eval(context),
            self._time_step,
            self._leash,
        )
        after = X_WT @ X_TG
        # At its limits the guide is slower than its command.
        turn = (after.rotation() @ before.rotation().inverse()).ToAngleAxis()
        shift = after.translation() - before.translation()
        velocity = np.concatenate((turn.angle() * turn.axis(), shift)) / self._time_step
        quaternion = after.rotation().ToQuaternion().wxyz()
        state.set_value(
            self._state,
            np.concatenate((after.translation(), quaternion, velocity, X_TG.translation())),
        )

    def _calc_pose(self, context: Context, output: Value) -> None:
        output.set_value(self._pose(context))

    def _calc_velocity(self, context: Context, output: Value) -> None:
        velocity = context.get_discrete_state(self._state).value()[7:13]
        output.set_value(SpatialVelocity(w=velocity[:3], v=velocity[3:]))

    def _calc_position(self, context: Context, output: BasicVector) -> None:
        values = self._values(context)
        hand = self.hand_pose_input
        output.SetFromVector(hand.Eval(context).translation() if values is None else values[13:])
