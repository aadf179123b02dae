"""The phase that all parts of a motion share."""

from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector_, LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from pepper_drake.learning.phase import extended_tau
from pepper_drake.learning.primitive import MovementPrimitive

# Parts of what is remembered beside the phase.
_GOAL, _NUMBER = slice(1, 4), 4


@TemplateSystem.define("CanonicalSystem_")
def CanonicalSystem_(T: type) -> type:
    """Makes `CanonicalSystem` for a scalar type."""

    class Impl(LeafSystem_[T]):
        """The canonical system of a primitive.

        .. pydrake_system::

            name: CanonicalSystem
            input_ports:
            - active
            - goal_position (optional)
            - slowdown (optional)
            - primitive (optional)
            output_ports:
            - phase
            - phase_velocity
            - tau

        tau x' = -alpha_x x / (1 + slowdown), x = 1 while `active` is 0 (equation 2.5 of the
        report, with phase stopping). tau is the nominal duration; while active it is extended in
        proportion to the displacement of the goal: each metre adds the time that the
        demonstration took for a metre of its way. A goal that moved by less than 3 mm did not
        move.

        Ports: `active` (1) 0, or the number of the motion: with another number a motion starts
        anew, from where the last one is (not in continuous time, where it is 0 or 1);
        `goal_position` (3) [m]; `slowdown` (1) >= 0; `primitive`, abstract MovementPrimitive, is
        performed in place of the one that the system was made with; `phase` (1) and `tau` (1) [s]
        are state; `phase_velocity` (1) [1/s] is that of the coming step.

        State: phase, tau [s], goal known (3) [m], number of the motion. Discrete with period
        `time_step`; with `time_step` 0 the phase is continuous, and tau and goal are updated after
        each step of the integrator. In continuous time, derivatives exist for Expression as well.
        """

        def _construct(
            self,
            primitive: MovementPrimitive,
            *,
            duration: float | None = None,
            time_step: float = 0.01,
            converter: Any = None,
        ) -> None:
            """Makes the system.

            Args:
                primitive: What is performed.
                duration: Nominal tau [s]; the demonstration's if left out.
                time_step: [s]; 0 for a continuous phase.
                converter: For the framework.
            """
            super().__init__(converter)
            self._primitive = primitive
            self._duration = duration
            self._time_step = time_step
            self.active_port = self.DeclareVectorInputPort("active", 1)
            self.goal_position_port = self.DeclareVectorInputPort("goal_position", 3)
            self.slowdown_port = self.DeclareVectorInputPort("slowdown", 1)
            self.primitive_port = self.DeclareAbstractInputPort(
                "primitive", Value[object](primitive)
            )

            memory = [primitive.duration if duration is None else duration, 0.0, 0.0, 0.0, 0.0]
            if time_step > 0.0:
                index = self.DeclareDiscreteState([1.0, *memory])
                now_tickets = {
                    self.discrete_state_ticket(index),
                    self.active_port.ticket(),
                    self.primitive_port.ticket(),
                }
                self.DeclareInitializationDiscreteUpdateEvent(self._rest)
                self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)
            else:
                self.DeclareContinuousState(BasicVector_[T]([1.0]))
                index = self.DeclareDiscreteState(memory)
                now_tickets = {self.xc_ticket(), self.discrete_state_ticket(index)}
                self.DeclareInitializationUnrestrictedUpdateEvent(self._update_between_steps)
                self.DeclarePerStepUnrestrictedUpdateEvent(self._update_between_steps)
            self.phase_port = self.DeclareVectorOutputPort(
                "phase",
                1,
                lambda context, out: out.SetFromVector([self._now(context)[0]]),
                prerequisites_of_calc=now_tickets,
            )
            self.phase_velocity_port = self.DeclareVectorOutputPort(
                "phase_velocity",
                1,
                lambda context, out: out.SetFromVector([self._phase_velocity(context)]),
                prerequisites_of_calc={
                    *now_tickets,
                    self.active_port.ticket(),
                    self.slowdown_port.ticket(),
                },
            )
            self.tau_port = self.DeclareVectorOutputPort(
                "tau",
                1,
                lambda context, out: out.SetFromVector([self._now(context)[1]]),
                prerequisites_of_calc=now_tickets,
            )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(
                self,
                other._primitive,
                duration=other._duration,
                time_step=other._time_step,
                converter=converter,
            )

        def _performed(self, context: Any) -> MovementPrimitive:
            if self.primitive_port.HasValue(context):
                performed: MovementPrimitive = self.primitive_port.Eval(context)
                return performed
            return self._primitive

        def _nominal_duration(self, context: Any) -> float:
            return self._performed(context).duration if self._duration is None else self._duration

        def _extension(self, context: Any) -> float:
            """Time for a metre of the goal's displacement [s/m]."""
            length = self._performed(context).path_length
            return self._performed(context).duration / length if length > 0.0 else 0.0

        def _memory(self, context: Any) -> Any:
            """Returns tau, the goal known (3) and the number of the motion."""
            values = context.get_discrete_state_vector().CopyToVector()
            return values[1:] if self._time_step > 0.0 else values

        def _now(self, context: Any) -> Any:
            """Returns phase and tau: of a motion that starts now, or as they are."""
            if self._time_step == 0.0:
                return context.get_continuous_state_vector()[0], self._memory(context)[0]
            if self._starts(context):
                return 1.0, self._nominal_duration(context)
            values = context.get_discrete_state_vector()
            return values[0], values[1]

        def _starts(self, context: Any) -> bool:
            number = self.active_port.Eval(context)[0]
            return bool(number > 0.5 and number != self._memory(context)[_NUMBER])

        def _phase_velocity(self, context: Any) -> Any:
            slowdown: Any = 0.0
            if self.slowdown_port.HasValue(context):
                slowdown = self.slowdown_port.Eval(context)[0]
            phase, tau = self._now(context)
            rate = self._performed(context).translation.alpha_x / (tau * (1.0 + slowdown))
            if self._time_step == 0.0:
                return -rate * phase * self.active_port.Eval(context)[0]
            return -rate * phase if self._is_active(context) else 0.0 * rate

        def _goal(self, context: Any, known: Any) -> Any:
            if self.goal_position_port.HasValue(context):
                return self.goal_position_port.Eval(context)
            return known

        def _is_active(self, context: Any) -> bool:
            return bool(self.active_port.Eval(context)[0] > 0.5)

        def _rest(self, context: Any, state: Any) -> None:
            goal = self._goal(context, np.zeros(3))
            state.set_value(np.concatenate(([1.0, self._nominal_duration(context)], goal, [0.0])))

        def _update(self, context: Any, state: Any) -> None:
            if not self._is_active(context):
                self._rest(context, state)
                return
            known = self._memory(context)[_GOAL]
            seen = self._goal(context, known)
            if self._starts(context):
                known = seen  # The goal that the motion starts with is the one to compare with.
            phase, tau = self._now(context)
            decay = -self._phase_velocity(context) / phase if phase > 0.0 else 0.0
            tau, known = extended_tau(tau, known, seen, self._extension(context))
            later = phase * np.exp(-decay * self._time_step)
            state.set_value(np.concatenate(([later, tau], known, self.active_port.Eval(context))))

        def _update_between_steps(self, context: Any, state: Any) -> None:
            memory = self._memory(context)
            seen = self._goal(context, memory[_GOAL])
            if self._is_active(context) and self._now(context)[0] < 1.0:
                tau, known = extended_tau(memory[0], memory[_GOAL], seen, self._extension(context))
            else:
                tau, known = self._nominal_duration(context), seen
                state.get_mutable_continuous_state().SetFromVector([1.0])
            state.get_mutable_discrete_state(0).SetFromVector(
                np.concatenate(([tau], known, self.active_port.Eval(context)))
            )

        def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
            if self._time_step == 0.0:
                derivatives.get_mutable_vector().SetFromVector([self._phase_velocity(context)])

    return Impl


CanonicalSystem = CanonicalSystem_[None]
