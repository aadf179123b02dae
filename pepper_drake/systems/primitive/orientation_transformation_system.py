"""The hand's orientation along a learned motion."""

from typing import Any

import numpy as np
from pydrake.common.value import Value

from pepper_drake.errors import InputError
from pepper_drake.learning.dmp.orientation import OrientationAttractor, OrientationState
from pepper_drake.learning.dmp.primitive import MovementPrimitive
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.systems.framework import LeafSystem, ValueProducer

_NUMBER, _SPEED = 13, 14
"""Indices of the motion's number and speed in the state."""


class OrientationTransformationSystem(LeafSystem):
    """The transformation system of a primitive's orientation, synchronised with its translation.

    .. pydrake_system::

        name: OrientationTransformationSystem
        input_ports:
        - movement
        - phase
        - phase_velocity
        - tau
        - goal_orientation
        - start_orientation
        - speed (optional)
        output_ports:
        - orientation
        - angular_velocity
        - next_orientation
        - next_angular_velocity

    See `learning.orientation` for the equations. Orientations are unit quaternions w, x, y, z of
    the hand, angular velocities [rad/s], both in the frame of the demonstration, normally T.

    Inputs: `movement`, abstract Movement: a motion restarts when its number changes, from the
    present orientation and angular velocity; `phase` (1), `phase_velocity` (1) [1/s], `tau` (1)
    [s] of the same `CanonicalSystem` as the translation; `goal_orientation` (4), followed smoothly;
    `start_orientation` (4), from which the motion starts; `speed` (1) as at the CanonicalSystem.

    Outputs: `orientation` (4) and `angular_velocity` (3), at full speed, are state;
    `next_orientation` (4) and `next_angular_velocity` (3) are the state one step ahead, fed through
    from all inputs. At rest they are `start_orientation` and zero.

    State: coordinates (3) [rad], their rates (3) [rad/s], coordinates at the start (3) [rad], the
    delayed goal of the spring (4), number and speed of the motion; discrete with period
    `time_step`.

    Examples:
        >>> from pydrake.systems.analysis import Simulator
        >>> from pydrake.systems.framework import DiagramBuilder
        >>> from pepper_drake.learning import Demonstration
        >>> from pepper_drake.systems import CanonicalSystem
        >>> times = np.linspace(0.0, 2.0, 201)
        >>> progress = 0.5 - 0.5 * np.cos(0.5 * np.pi * times)
        >>> half = 0.25 * np.pi * progress  # Half the angle of a quarter turn about z.
        >>> zero = np.zeros_like(progress)
        >>> turns = np.column_stack((np.cos(half), zero, zero, np.sin(half)))
        >>> positions = np.outer(progress, [0.2, 0.0, 0.1])
        >>> demonstration = Demonstration.from_positions(times, positions, rotations=turns)
        >>> primitive = MovementPrimitive.fit(demonstration)
        >>> builder = DiagramBuilder()
        >>> clock = builder.AddSystem(CanonicalSystem(primitive))
        >>> turn = builder.AddSystem(OrientationTransformationSystem(primitive))
        >>> for name in ("phase", "phase_velocity", "tau"):
        ...     builder.Connect(clock.GetOutputPort(name), turn.GetInputPort(name))
        >>> simulator = Simulator(builder.Build())
        >>> root = simulator.get_mutable_context()
        >>> movement = Value[object](Movement(primitive, id=1))
        >>> for system in (clock, turn):
        ...     own = system.GetMyMutableContextFromRoot(root)
        ...     _ = system.movement_port.FixValue(own, movement)
        >>> _ = turn.start_orientation_port.FixValue(own, [1.0, 0.0, 0.0, 0.0])
        >>> _ = turn.goal_orientation_port.FixValue(own, [0.8, 0.6, 0.0, 0.0])
        >>> _ = simulator.AdvanceTo(4.0)
        >>> print(turn.orientation_port.Eval(own).round(2) + 0.0)
        [0.8 0.6 0.  0. ]
    """

    def __init__(
        self,
        primitive: MovementPrimitive,
        *,
        time_step: float = 0.01,
        start_moving: bool = False,
    ) -> None:
        """Makes the system.

        Args:
            primitive: An example of the primitives to perform.
            time_step: [s].
            start_moving: Whether the motion starts with the demonstration's angular velocity, or
                from rest; see `TransformationSystem`.

        Raises:
            InputError: The primitive has no orientation.
        """
        super().__init__()
        if primitive.orientation is None:
            raise InputError(
                f"{primitive.name}: the primitive has no orientation; learn it from a"
                " demonstration with rotations"
            )
        self._time_step = time_step
        self._start_moving = start_moving
        self.movement_port = self.DeclareAbstractInputPort(
            "movement", Value[object](Movement(primitive))
        )
        self.phase_port = self.DeclareVectorInputPort("phase", 1)
        self.phase_velocity_port = self.DeclareVectorInputPort("phase_velocity", 1)
        self.tau_port = self.DeclareVectorInputPort("tau", 1)
        self.goal_orientation_port = self.DeclareVectorInputPort("goal_orientation", 4)
        self.start_orientation_port = self.DeclareVectorInputPort("start_orientation", 4)
        self.speed_port = self.DeclareVectorInputPort("speed", 1)

        # The goal is the identity, so that an uninitialised context is valid as well.
        index = self.DeclareDiscreteState([0.0] * 9 + [1.0, 0.0, 0.0, 0.0] + [0.0, 1.0])
        self.DeclareInitializationDiscreteUpdateEvent(self._rest)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)
        state_ticket = self.discrete_state_ticket(index)
        self._next = self.DeclareCacheEntry(
            "next state",
            ValueProducer(allocate=lambda: Value({}), calc=self._calc_next_state),
            prerequisites_of_calc={
                state_ticket,
                *(self.get_input_port(k).ticket() for k in range(self.num_input_ports())),
            },
        )

        def output(name: str, size: int, calc: Any, tickets: set[Any]) -> Any:
            return self.DeclareVectorOutputPort(
                name,
                size,
                lambda context, out: out.SetFromVector(calc(context)),
                prerequisites_of_calc=tickets,
            )

        self.orientation_port = output(
            "orientation",
            4,
            lambda c: self._learned(c).orientation_of(self._state(c)),
            {state_ticket, self.movement_port.ticket()},
        )
        self.angular_velocity_port = output(
            "angular_velocity",
            3,
            lambda c: self._learned(c).angular_velocity_of(self._state(c)),
            {state_ticket, self.movement_port.ticket()},
        )
        cached = {self._next.ticket()}
        self.next_orientation_port = output(
            "next_orientation",
            4,
            lambda c: self._learned(c).orientation_of(self._next_state(c)),
            cached,
        )
        self.next_angular_velocity_port = output(
            "next_angular_velocity",
            3,
            self._next_angular_velocity,
            cached,
        )

    def _state(self, context: Any) -> OrientationState:
        return _state(context.get_discrete_state_vector().CopyToVector())

    def _state_now(self, context: Any, speed: float) -> OrientationState:
        """Returns the state, reset if a motion starts now."""
        values = context.get_discrete_state_vector().CopyToVector()
        state = _state(values)
        if self._movement(context).begins_after(values[_NUMBER]):
            goal = self.goal_orientation_port.Eval(context)
            return self._learned(context).started_anew(state, goal, speed / values[_SPEED])
        return state

    def _speed(self, context: Any) -> float:
        """Returns the speed scale of the motion, from 0 to 1."""
        port = self.speed_port
        return float(port.Eval(context)[0]) if port.HasValue(context) else 1.0

    def _learned(self, context: Any) -> OrientationAttractor:
        orientation = self._movement(context).primitive.orientation
        assert orientation is not None
        return orientation

    def _movement(self, context: Any) -> Movement:
        movement: Movement = self.movement_port.Eval(context)
        return movement

    def _next_angular_velocity(self, context: Any) -> Any:
        if not self._movement(context).runs:
            return np.zeros(3)
        return self._learned(context).angular_velocity_of(self._next_state(context))

    def _start_state(self, context: Any) -> OrientationState:
        tau = float(self.tau_port.Eval(context)[0]) if self._start_moving else None
        return self._learned(context).start_state(
            self.start_orientation_port.Eval(context),
            self.goal_orientation_port.Eval(context),
            tau,
        )

    def _calc_next_state(self, context: Any, value: Any) -> None:
        if self._movement(context).runs:
            phase = float(self.phase_port.Eval(context)[0])
            velocity = float(self.phase_velocity_port.Eval(context)[0])
            speed = self._speed(context)
            later = self._learned(context).advance(
                self._state_now(context, speed),
                self.goal_orientation_port.Eval(context),
                phase,
                -velocity / (speed * phase) if speed * phase > 0.0 else 0.0,
                float(self.tau_port.Eval(context)[0]),
                speed * self._time_step,
            )
        else:
            later = self._start_state(context)
        value.get_mutable_value()["state"] = later

    def _next_state(self, context: Any) -> OrientationState:
        state: OrientationState = self._next.Eval(context)["state"]
        return state

    def _rest(self, context: Any, discrete: Any) -> None:
        discrete.set_value(_values(self._start_state(context), 0.0, 1.0))

    def _update(self, context: Any, discrete: Any) -> None:
        number = float(self._movement(context).id)
        discrete.set_value(_values(self._next_state(context), number, self._speed(context)))


def _state(values: Any) -> OrientationState:
    return OrientationState(values[:6].reshape(2, 3), values[6:9], values[9:_NUMBER])


def _values(state: OrientationState, number: float, speed: float) -> Any:
    return np.concatenate((state.coordinates.ravel(), state.start, state.goal, [number, speed]))
