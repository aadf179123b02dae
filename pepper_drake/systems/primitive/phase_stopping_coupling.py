"""Phase stopping: the movement waits for a hand that is held or pushed."""

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, DiscreteValues

from pepper_drake.learning.dmp.phase_stopping import PhaseStopping
from pepper_drake.systems.framework import LeafSystem


class PhaseStoppingCoupling(LeafSystem):
    """Couples phase and desired position to the hand's tracking error; see `PhaseStopping`.

    .. pydrake_system::

        name: PhaseStoppingCoupling
        input_ports:
        - movement
        - desired_position
        - measured_position
        output_ports:
        - slowdown
        - coupling

    Inputs: `movement`, abstract Movement; `desired_position` (3) and `measured_position` (3) [m] of
    the hand, in one frame, normally T. Outputs: `slowdown` (1) for a CanonicalSystem, `coupling`
    (3) [m] for a TransformationSystem; both are zero at rest.

    State: the filtered error (3) [m], discrete with period `time_step`.

    Examples:
        >>> from pydrake.systems.analysis import Simulator
        >>> from pepper_drake.planning.reach.movement import Movement
        >>> system = PhaseStoppingCoupling()
        >>> simulator = Simulator(system)
        >>> context = simulator.get_mutable_context()
        >>> movement = Value[object](Movement(None, id=1))
        >>> _ = system.movement_input.FixValue(context, movement)
        >>> _ = system.desired_position_input.FixValue(context, [0.1, 0.0, 0.0])
        >>> _ = system.measured_position_input.FixValue(context, [0.0, 0.0, 0.0])
        >>> _ = simulator.AdvanceTo(1.0)
        >>> bool(system.slowdown_output.Eval(context)[0] > 1.0)  # Held back: it waits.
        True
    """

    def __init__(self, law: PhaseStopping | None = None, time_step: float = 0.01) -> None:
        """Makes the system.

        Args:
            law: Parameters of the coupling.
            time_step: [s].
        """
        super().__init__()
        self._law, self._time_step = law or PhaseStopping(), time_step
        self.movement_input = self.DeclareAbstractInputPort("movement", Value[object](None))
        self.desired_position_input = self.DeclareVectorInputPort("desired_position", 3)
        self.measured_position_input = self.DeclareVectorInputPort("measured_position", 3)
        self._error = self.DeclareDiscreteState(3)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)
        state = {self.discrete_state_ticket(self._error)}
        self.slowdown_output = self.DeclareVectorOutputPort(
            "slowdown", 1, self._calc_slowdown, state
        )
        self.coupling_output = self.DeclareVectorOutputPort(
            "coupling", 3, self._calc_coupling, state
        )

    def _update(self, context: Context, state: DiscreteValues) -> None:
        error = np.zeros(3)
        if self.movement_input.Eval(context).runs:
            deviation = self.measured_position_input.Eval(
                context
            ) - self.desired_position_input.Eval(context)
            now = context.get_discrete_state(self._error).value()
            error = self._law.error_after(now, deviation, self._time_step)
        state.set_value(self._error, error)

    def _calc_slowdown(self, context: Context, output: BasicVector) -> None:
        error = context.get_discrete_state(self._error).value()
        output.SetFromVector([self._law.slowdown(error)])

    def _calc_coupling(self, context: Context, output: BasicVector) -> None:
        error = context.get_discrete_state(self._error).value()
        output.SetFromVector(self._law.coupling(error))
