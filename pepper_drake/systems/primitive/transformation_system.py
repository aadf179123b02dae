"""The hand's position along a learned motion."""

import sys
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector_, LeafSystem_
from pydrake.systems.scalar_conversion import TemplateSystem

from pepper_drake.learning.dmp.motion_state import (
    DELAYED,
    GOAL,
    NUM_VALUES,
    POSITION,
    START,
    VELOCITY,
    MotionNow,
    start_state,
    state_started_anew,
)
from pepper_drake.learning.dmp.primitive import MovementPrimitive
from pepper_drake.learning.dmp.transformation import DelayedGoal, TransformationModel
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.systems.framework import ValueProducer, leaf_system


# Without a scope Drake reads the sources of all that import this module: half a second.
@TemplateSystem.define("TransformationSystem_", scope=sys.modules[__name__])
def TransformationSystem_(T: type) -> type:
    """Makes `TransformationSystem` for a scalar type."""

    class Impl(leaf_system(LeafSystem_[T])):  # type: ignore[misc]
        """The transformation system of a primitive's translation.

        .. pydrake_system::

            name: TransformationSystem
            input_ports:
            - movement
            - phase
            - phase_velocity
            - tau
            - goal_position
            - start_position
            - goal_velocity (optional)
            - coupling (optional)
            - speed (optional)
            output_ports:
            - position
            - velocity
            - nominal_acceleration
            - delayed_goal_position
            - next_position
            - next_velocity

        tau² y'' = alpha_z (beta_z (g - y) + tau (g' - y')) + f(x) + C_t (equations 2.4 to 2.6 of
        the report); each step is the one of `learning.spring`. All vectors are in the frame of the
        demonstration, normally T.

        Inputs: `movement`, abstract Movement: a motion restarts when its number changes, from the
        present position and velocity (not in continuous time, where all numbers above 0 are the
        same); `phase` (1), `phase_velocity` (1) [1/s], `tau` (1) [s] of a `CanonicalSystem`;
        `goal_position` (3) [m], followed smoothly, displacements below 3 mm ignored;
        `goal_velocity` (3) [m/s] if known; `start_position` (3) [m], the hand's position, from
        which the motion starts; `coupling` (3) [m], C_t; `speed` (1) as at the CanonicalSystem, for
        discrete time.

        Outputs: `position` (3) [m], `velocity` (3) at full speed [m/s] and `delayed_goal_position`
        (3) [m], the goal of the spring, are state. `nominal_acceleration` (3) [m/s²] depends on
        neither coupling nor `phase_velocity`. `next_position` and `next_velocity` are the state one
        step ahead, fed through from all inputs: a follower of them has no delay. At rest they are
        `start_position` and zero.

        State: position, velocity, goal, delayed goal, start, each (3), number and speed of the
        motion. Discrete with period `time_step`. With `time_step` 0 position, velocity and delayed
        goal are continuous and the rest is updated after each step of the integrator; the two
        ports of the next step do not exist. The time derivatives support Expression as well.

        Parameters: numeric parameter 0 holds the weights of the forcing term, row by row, if the
        approximator has any; AutoDiffXd gives gradients with respect to them. They are used while
        the movement's primitive is the one that the system was made with.

        Args:
            primitive: An example of the primitives to perform.
            time_step: [s]; 0 for a continuous state.
            start_moving: Whether the motion starts with the demonstration's velocity, as a rollout
                does, or from rest, as a hand does. With it, `velocity` has that start velocity
                already at rest.

        Examples:
            >>> from pydrake.systems.analysis import Simulator
            >>> from pydrake.systems.framework import DiagramBuilder
            >>> from pepper_drake.learning.demonstrations.synthetic import example_demonstrations
            >>> from pepper_drake.systems import CanonicalSystem
            >>> primitive = MovementPrimitive.fit(example_demonstrations(1)[0])
            >>> builder = DiagramBuilder()
            >>> clock = builder.AddSystem(CanonicalSystem(primitive))
            >>> motion = builder.AddSystem(TransformationSystem(primitive))
            >>> for name in ("phase", "phase_velocity", "tau"):
            ...     builder.Connect(clock.GetOutputPort(name), motion.GetInputPort(name))
            >>> simulator = Simulator(builder.Build())
            >>> root = simulator.get_mutable_context()
            >>> movement = Value[object](Movement(primitive, id=1))
            >>> for system in (clock, motion):
            ...     own = system.GetMyMutableContextFromRoot(root)
            ...     _ = system.movement_port.FixValue(own, movement)
            >>> _ = motion.start_position_port.FixValue(own, [0.0, -0.2, 0.0])
            >>> _ = motion.goal_position_port.FixValue(own, [0.2, -0.2, 0.1])
            >>> _ = simulator.AdvanceTo(2.0 * primitive.duration)
            >>> print(motion.position_port.Eval(own).round(3) + 0.0)
            [ 0.2 -0.2  0.1]
        """

        def _construct(
            self,
            primitive: MovementPrimitive,
            *,
            time_step: float = 0.01,
            start_moving: bool = False,
            converter: Any = None,
        ) -> None:
            super().__init__(converter)
            self._primitive = primitive
            self._time_step = time_step
            self._start_moving = start_moving
            self._attractor = primitive.translation
            model = self._attractor.linear_model
            self._weights_shape = None if model is None else model.weights.shape
            if model is not None:
                self.DeclareNumericParameter(BasicVector_[T](model.weights.ravel()))

            declare = self.DeclareVectorInputPort
            self.phase_port = declare("phase", 1)
            self.phase_velocity_port = declare("phase_velocity", 1)
            self.tau_port = declare("tau", 1)
            self.goal_position_port = declare("goal_position", 3)
            self.start_position_port = declare("start_position", 3)
            self.goal_velocity_port = declare("goal_velocity", 3)
            self.coupling_port = declare("coupling", 3)
            self.speed_port = declare("speed", 1)
            self.movement_port = self.DeclareAbstractInputPort(
                "movement", Value[object](Movement(primitive))
            )

            if time_step > 0.0:
                index = self.DeclareDiscreteState([0.0] * 16 + [1.0])
                state_tickets = {self.discrete_state_ticket(index)}
                self.DeclareInitializationDiscreteUpdateEvent(self._rest)
                self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)
            else:
                self.DeclareContinuousState(3, 3, 3)
                index = self.DeclareDiscreteState(6)
                state_tickets = {self.xc_ticket(), self.discrete_state_ticket(index)}
                self.DeclareInitializationUnrestrictedUpdateEvent(self._update_between_steps)
                self.DeclarePerStepUnrestrictedUpdateEvent(self._update_between_steps)

            def output(name: str, calc: Any, tickets: set[Any]) -> Any:
                return self.DeclareVectorOutputPort(
                    name,
                    3,
                    lambda context, out: out.SetFromVector(calc(context)),
                    prerequisites_of_calc=tickets,
                )

            self.position_port = output(
                "position", lambda c: self._state(c)[POSITION], state_tickets
            )
            self.velocity_port = output(
                "velocity", lambda c: self._state(c)[VELOCITY], state_tickets
            )
            output("delayed_goal_position", lambda c: self._state(c)[DELAYED], state_tickets)

            def tickets(*names: str) -> set[Any]:
                return {self.GetInputPort(name).ticket() for name in names}

            nominal_tickets = state_tickets | tickets(
                "movement", "phase", "tau", "goal_position", "goal_velocity", "speed"
            )
            if self._weights_shape is not None:
                nominal_tickets |= {self.all_parameters_ticket()}
            self._present_entry = self.DeclareCacheEntry(
                "present",
                ValueProducer(allocate=lambda: Value({}), calc=self._calc_present),
                prerequisites_of_calc=nominal_tickets,
            )
            present = {self._present_entry.ticket()}
            self.nominal_acceleration_port = output(
                "nominal_acceleration", self._nominal_acceleration, present
            )
            if time_step > 0.0:
                next_tickets = present | tickets("phase_velocity", "start_position", "coupling")
                self._next = self.DeclareCacheEntry(
                    "next state",
                    ValueProducer(allocate=lambda: Value({}), calc=self._calc_next_state),
                    prerequisites_of_calc=next_tickets,
                )
                cached = {self._next.ticket()}
                self.next_position_port = output(
                    "next_position", lambda c: self._next_state(c)[POSITION], cached
                )
                self.next_velocity_port = output(
                    "next_velocity",
                    lambda c: self._next_state(c)[VELOCITY] * self._movement(c).runs,
                    cached,
                )

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(
                self,
                other._primitive,
                time_step=other._time_step,
                start_moving=other._start_moving,
                converter=converter,
            )

        def _state(self, context: Any) -> Any:
            """Returns position, velocity, goal, delayed goal, start: (15,)."""
            discrete = context.get_discrete_state_vector().CopyToVector()
            if self._time_step > 0.0:
                return discrete[:NUM_VALUES]
            continuous = context.get_continuous_state_vector().CopyToVector()
            return np.concatenate((continuous[:6], discrete[:3], continuous[6:], discrete[3:]))

        def _state_now(self, context: Any) -> Any:
            """Returns the state (15,), reset if a motion starts now."""
            if self._time_step == 0.0:
                return self._state(context)
            values = context.get_discrete_state_vector().CopyToVector()
            if self._movement(context).begins_after(values[-2]):
                goal, speed = self.goal_position_port.Eval(context), self._speed(context)
                return state_started_anew(values[:NUM_VALUES], goal, speed / values[-1])
            return values[:NUM_VALUES]

        def _movement(self, context: Any) -> Movement:
            movement: Movement = self.movement_port.Eval(context)
            return movement

        def _optional(self, port: Any, context: Any) -> Any:
            return port.Eval(context) if port.HasValue(context) else np.zeros(3)

        def _speed(self, context: Any) -> Any:
            return self.speed_port.Eval(context)[0] if self.speed_port.HasValue(context) else 1.0

        def _weights(self, context: Any, attractor: TransformationModel) -> Any:
            """Returns the weights from the context's parameters, None if they are not used."""
            if self._weights_shape is None or attractor is not self._attractor:
                return None
            weights = context.get_numeric_parameter(0).CopyToVector()
            return weights.reshape(self._weights_shape)

        def _calc_present(self, context: Any, value: Any) -> None:
            state = self._state_now(context)
            attractor = self._movement(context).primitive.translation
            weights = self._weights(context, attractor)
            value.get_mutable_value()["present"] = MotionNow(
                attractor,
                state,
                self._goal(context, state),
                attractor.forcing(state[START], state[DELAYED], weights),
                self.phase_port.Eval(context)[0],
                self.tau_port.Eval(context)[0],
            )

        def _present(self, context: Any) -> MotionNow:
            present: MotionNow = self._present_entry.Eval(context)["present"]
            return present

        def _goal(self, context: Any, state: Any) -> DelayedGoal:
            velocity = self._optional(self.goal_velocity_port, context)
            goal = DelayedGoal(np.array((state[GOAL], velocity)), state[DELAYED] - state[GOAL])
            if self._time_step == 0.0:
                return goal
            return goal.seen(self.goal_position_port.Eval(context))

        def _nominal_acceleration(self, context: Any) -> Any:
            return self._present(context).acceleration() * self._movement(context).runs

        def _start_state(self, context: Any) -> Any:
            """Returns the state (15,) of a motion that starts now."""
            start = self.start_position_port.Eval(context)
            goal = self.goal_position_port.Eval(context)
            if not self._start_moving:
                return start_state(start, goal)
            attractor = self._movement(context).primitive.translation
            velocity = attractor.start_velocity(start, goal, self.tau_port.Eval(context)[0])
            return start_state(start, goal, velocity)

        def _calc_next_state(self, context: Any, value: Any) -> None:
            movement = self._movement(context)
            if movement.runs:
                speed = self._speed(context)
                later = self._present(context).later(
                    self._time_step,
                    self.phase_velocity_port.Eval(context)[0],
                    self._optional(self.coupling_port, context),
                    speed,
                )
                state = np.concatenate((later, [movement.id, speed]))
            else:
                state = self._resting_state(context)
            value.get_mutable_value()["state"] = state

        def _next_state(self, context: Any) -> Any:
            return self._next.Eval(context)["state"]

        def _resting_state(self, context: Any) -> Any:
            return np.concatenate((self._start_state(context), [0.0, 1.0]))

        def _rest(self, context: Any, discrete: Any) -> None:
            discrete.set_value(self._resting_state(context))

        def _update(self, context: Any, discrete: Any) -> None:
            discrete.set_value(self._next_state(context))

        def _update_between_steps(self, context: Any, state: Any) -> None:
            values = self._state(context)
            phase = self.phase_port.Eval(context)[0]
            if self._movement(context).runs and phase < 1.0:
                seen = self.goal_position_port.Eval(context)
                values[GOAL] = self._goal(context, values).seen(seen).position
            else:
                values = self._start_state(context)
                continuous = np.concatenate((values[:6], values[DELAYED]))
                state.get_mutable_continuous_state().SetFromVector(continuous)
            memory = np.concatenate((values[GOAL], values[START]))
            state.get_mutable_discrete_state(0).SetFromVector(memory)

        def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
            if self._time_step > 0.0:
                return
            rates = self._present(context).rates(self._optional(self.coupling_port, context))
            derivatives.get_mutable_vector().SetFromVector(rates * self._movement(context).runs)

    return Impl


TransformationSystem = TransformationSystem_[None]
