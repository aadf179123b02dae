"""The phase variable shared by all parts of a motion."""

import sys
from typing import Any, NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector_, LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from pepper_drake.learning.dmp.primitive import MovementPrimitive
from pepper_drake.learning.phase import extended_tau
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.systems.framework import ValueProducer, leaf_system

# Elements of the state after the phase.
_GOAL, _NUMBER = slice(1, 4), 4


class _Present(NamedTuple):
    """Present state of the motion, reset if a motion starts now.

    Attributes:
        movement: The movement performed.
        phase: The phase.
        tau: The duration tau [s].
        starts: Whether a motion starts now.
    """

    movement: Movement
    phase: Any
    tau: Any
    starts: bool

    @property
    def primitive(self) -> MovementPrimitive:
        """The movement's primitive."""
        return self.movement.primitive


# Without a scope Drake reads the sources of all that import this module: half a second.
@TemplateSystem.define("CanonicalSystem_", scope=sys.modules[__name__])
def CanonicalSystem_(T: type) -> type:
    """Makes `CanonicalSystem` for a scalar type."""

    class Impl(leaf_system(LeafSystem_[T])):  # type: ignore[misc]
        """The canonical system of a primitive.

        .. pydrake_system::

            name: CanonicalSystem
            input_ports:
            - movement
            - goal_position (optional)
            - slowdown (optional)
            - speed (optional)
            output_ports:
            - phase
            - phase_velocity
            - tau

        tau x' = -speed alpha_x x / (1 + slowdown), x = 1 while no movement runs (equation 2.5 of
        the report, with phase stopping). tau is the nominal duration; during a movement it is
        extended in proportion to the goal's displacement: each metre adds the time that the
        demonstration took for a metre of its path. Displacements below 3 mm are ignored.

        Ports: `movement`, abstract Movement: a motion restarts when its number changes (not in
        continuous time, where all numbers above 0 are the same); `goal_position` (3) [m];
        `slowdown` (1) >= 0; `speed` (1), a fraction from 0 to 1 that scales the speed of the whole
        motion, 1 if unconnected; `phase` (1) and `tau` (1) [s] are state; `phase_velocity` (1)
        [1/s] is that of the coming step.

        State: phase, tau [s], the motion's first goal (3) [m], number of the motion. Discrete with
        period `time_step`; with `time_step` 0 the phase is continuous, and tau and goal are updated
        after each step of the integrator. The time derivatives support Expression as well.

        Args:
            primitive: An example of the primitives to perform.
            duration: Nominal tau [s]; the demonstration's if omitted.
            time_step: [s]; 0 for a continuous phase.

        Examples:
            >>> from pydrake.systems.analysis import Simulator
            >>> from pepper_drake.learning.demonstrations.synthetic import example_demonstrations
            >>> primitive = MovementPrimitive.fit(example_demonstrations(1)[0])
            >>> system = CanonicalSystem(primitive, duration=2.0)
            >>> simulator = Simulator(system)
            >>> context = simulator.get_mutable_context()
            >>> movement = Value[object](Movement(primitive, id=1))
            >>> _ = system.movement_port.FixValue(context, movement)
            >>> _ = simulator.AdvanceTo(1.0)
            >>> print(f"{system.phase_port.Eval(context)[0]:.3f}")
            0.016
        """

        def _construct(
            self,
            primitive: MovementPrimitive,
            *,
            duration: float | None = None,
            time_step: float = 0.01,
            converter: Any = None,
        ) -> None:
            super().__init__(converter)
            self._primitive = primitive
            self._duration = duration
            self._time_step = time_step
            self.movement_port = self.DeclareAbstractInputPort(
                "movement", Value[object](Movement(primitive))
            )
            self.goal_position_port = self.DeclareVectorInputPort("goal_position", 3)
            self.slowdown_port = self.DeclareVectorInputPort("slowdown", 1)
            self.speed_port = self.DeclareVectorInputPort("speed", 1)

            memory = [primitive.duration if duration is None else duration, 0.0, 0.0, 0.0, 0.0]
            if time_step > 0.0:
                index = self.DeclareDiscreteState([1.0, *memory])
                now_tickets = {
                    self.discrete_state_ticket(index),
                    self.movement_port.ticket(),
                }
                self.DeclareInitializationDiscreteUpdateEvent(self._rest)
                self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)
            else:
                self.DeclareContinuousState(BasicVector_[T]([1.0]))
                index = self.DeclareDiscreteState(memory)
                now_tickets = {
                    self.xc_ticket(),
                    self.discrete_state_ticket(index),
                    self.movement_port.ticket(),
                }
                self.DeclareInitializationUnrestrictedUpdateEvent(self._update_between_steps)
                self.DeclarePerStepUnrestrictedUpdateEvent(self._update_between_steps)
            self._present_entry = self.DeclareCacheEntry(
                "present",
                ValueProducer(allocate=lambda: Value({}), calc=self._calc_present),
                prerequisites_of_calc=now_tickets,
            )
            present = {self._present_entry.ticket()}
            self.phase_port = self.DeclareVectorOutputPort(
                "phase",
                1,
                lambda context, out: out.SetFromVector([self._present(context).phase]),
                prerequisites_of_calc=present,
            )
            self.phase_velocity_port = self.DeclareVectorOutputPort(
                "phase_velocity",
                1,
                lambda context, out: out.SetFromVector([self._phase_velocity(context)]),
                prerequisites_of_calc=present
                | {self.slowdown_port.ticket(), self.speed_port.ticket()},
            )
            self.tau_port = self.DeclareVectorOutputPort(
                "tau",
                1,
                lambda context, out: out.SetFromVector([self._present(context).tau]),
                prerequisites_of_calc=present,
            )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(
                self,
                other._primitive,
                duration=other._duration,
                time_step=other._time_step,
                converter=converter,
            )

        def _movement(self, context: Any) -> Movement:
            movement: Movement = self.movement_port.Eval(context)
            return movement

        def _nominal_duration(self, primitive: MovementPrimitive) -> float:
            return primitive.duration if self._duration is None else self._duration

        def _memory(self, context: Any) -> Any:
            """Returns tau, the motion's first goal (3) and the number of the motion."""
            values = context.get_discrete_state_vector().CopyToVector()
            return values[1:] if self._time_step > 0.0 else values

        def _calc_present(self, context: Any, value: Any) -> None:
            movement, memory = self._movement(context), self._memory(context)
            if self._time_step == 0.0:
                phase, starts = context.get_continuous_state_vector()[0], False
            else:
                phase = context.get_discrete_state_vector()[0]
                starts = movement.begins_after(memory[_NUMBER])
            tau = memory[0]
            if starts:
                phase, tau = 1.0, self._nominal_duration(movement.primitive)
            value.get_mutable_value()["present"] = _Present(movement, phase, tau, starts)

        def _present(self, context: Any) -> _Present:
            present: _Present = self._present_entry.Eval(context)["present"]
            return present

        def _phase_velocity(self, context: Any) -> Any:
            slowdown: Any = 0.0
            speed: Any = 1.0
            if self.speed_port.HasValue(context):
                speed = self.speed_port.Eval(context)[0]
            if self.slowdown_port.HasValue(context):
                slowdown = self.slowdown_port.Eval(context)[0]
            now = self._present(context)
            rate = speed * now.primitive.translation.alpha_x / (now.tau * (1.0 + slowdown))
            return -rate * now.phase * now.movement.runs

        def _goal(self, context: Any, known: Any) -> Any:
            if self.goal_position_port.HasValue(context):
                return self.goal_position_port.Eval(context)
            return known

        def _rest(self, context: Any, state: Any) -> None:
            goal = self._goal(context, np.zeros(3))
            duration = self._nominal_duration(self._movement(context).primitive)
            state.set_value(np.concatenate(([1.0, duration], goal, [0.0])))

        def _update(self, context: Any, state: Any) -> None:
            number = self._movement(context).id
            if not number:
                self._rest(context, state)
                return
            known = self._memory(context)[_GOAL]
            seen = self._goal(context, known)
            now = self._present(context)
            if now.starts:
                known = seen  # Displacement is measured from the goal at the start of the motion.
            velocity = self.phase_velocity_port.Eval(context)[0]
            decay = -velocity / now.phase if now.phase > 0.0 else 0.0
            nominal = self._nominal_duration(now.primitive)
            tau = extended_tau(now.tau, nominal, known, seen, _extension(now.primitive))
            later = now.phase * np.exp(-decay * self._time_step)
            state.set_value(np.concatenate(([later, tau], known, [number])))

        def _update_between_steps(self, context: Any, state: Any) -> None:
            now, known = self._present(context), self._memory(context)[_GOAL]
            seen = self._goal(context, known)
            if now.movement.runs and now.phase < 1.0:
                nominal = self._nominal_duration(now.primitive)
                tau = extended_tau(now.tau, nominal, known, seen, _extension(now.primitive))
            else:
                tau, known = self._nominal_duration(now.primitive), seen
                state.get_mutable_continuous_state().SetFromVector([1.0])
            state.get_mutable_discrete_state(0).SetFromVector(
                np.concatenate(([tau], known, [now.movement.id]))
            )

        def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
            if self._time_step == 0.0:
                derivatives.get_mutable_vector().SetFromVector([self._phase_velocity(context)])

    return Impl


def _extension(primitive: MovementPrimitive) -> float:
    """Returns the extra duration per metre of goal displacement [s/m]."""
    length = primitive.path_length
    return primitive.duration / length if length > 0.0 else 0.0


CanonicalSystem = CanonicalSystem_[None]
