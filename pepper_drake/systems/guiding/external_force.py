"""Pushes at the hand: scripted, and applied to the plant."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from pydrake.common.value import Value
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import Frame
from pydrake.systems.framework import BasicVector, Context, DiscreteValues

from pepper_drake.systems.framework import LeafSystem

Vector = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ForcePulse:
    """A constant force of limited duration."""

    force: tuple[float, float, float]
    """On the hand, in W [N]."""
    start: float
    """Time since the movement began [s]."""
    duration: float
    """[s]."""

    def at(self, time: float) -> Vector:
        """Returns torque and force (6,) in W [N m, N] at a time since the movement began."""
        pushing = self.start <= time < self.start + self.duration
        return np.r_[np.zeros(3), self.force] if pushing else np.zeros(6)


def force_at(frame: Frame, force: Vector) -> ExternallyAppliedSpatialForce:
    """Returns a torque and a force at a frame's origin in the plant's format.

    Args:
        frame: On a body, of a finalized plant.
        force: (6,) torque and force in W [N m, N].
    """
    applied = ExternallyAppliedSpatialForce()
    applied.body_index = frame.body().index()
    applied.p_BoBq_B = frame.GetFixedPoseInBodyFrame().translation()
    applied.F_Bq_W = SpatialForce(tau=force[:3], f=force[3:])
    return applied


class ScriptedForce(LeafSystem):
    """Plays the sum of push scripts from the start of the movement.

    .. pydrake_system::

        name: ScriptedForce
        input_ports:
        - active
        output_ports:
        - push

    `active` (1) is 0 or 1; `push` (6) torque and force in W [N m, N], held for each `time_step`.
    State: time since `active` became 1, or -1 before, and the push (7).
    """

    def __init__(self, *scripts: ForcePulse, time_step: float = 0.01) -> None:
        """Makes the system.

        Args:
            scripts: The pushes.
            time_step: [s].
        """
        super().__init__()
        self._scripts, self._time_step = scripts, time_step
        self.active_input = self.DeclareVectorInputPort("active", 1)
        self._state = self.DeclareDiscreteState([-1.0] + [0.0] * 6)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)
        self.push_output = self.DeclareVectorOutputPort(
            "push", 6, self._calc_push, {self.discrete_state_ticket(self._state)}
        )

    def _update(self, context: Context, state: DiscreteValues) -> None:
        since = context.get_discrete_state(self._state).value()[0]
        active = self.active_input.Eval(context)[0] > 0.5
        # Half a step keeps the accumulated time clear of the scripts' edges.
        since = (since + self._time_step if since >= 0.0 else 0.0) if active else -1.0
        push = np.zeros(6)
        if active:
            push += sum((s.at(since + 0.5 * self._time_step) for s in self._scripts), np.zeros(6))
        state.set_value(self._state, np.r_[since, push])

    def _calc_push(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(context.get_discrete_state(self._state).value()[1:])


class HandForce(LeafSystem):
    """Applies a torque and a force at a frame of the robot.

    .. pydrake_system::

        name: HandForce
        input_ports:
        - force (optional)
        output_ports:
        - spatial_forces

    `force` (6) torque and force at the frame's origin, in W [N m, N], none if unconnected; it
    should be held between ticks, as the plant evaluates it at each of its steps. `spatial_forces`
    goes to the plant's applied_spatial_force port.

    Args:
        frame: On the robot, of a finalized plant.
    """

    def __init__(self, frame: Frame) -> None:
        super().__init__()
        self._frame = frame
        self.force_input = self.DeclareVectorInputPort("force", 6)
        self.spatial_forces_output = self.DeclareAbstractOutputPort(
            "spatial_forces",
            lambda: Value([ExternallyAppliedSpatialForce()]),
            self._calc_forces,
            {self.force_input.ticket()},
        )

    def _calc_forces(self, context: Context, output: Value) -> None:
        if not self.force_input.HasValue(context):
            output.set_value([])
            return
        output.set_value([force_at(self._frame, self.force_input.Eval(context))])
