"""Smooths a target that jumps, such as a slider's."""

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import Context, DiscreteValues, InputPort, OutputPort

from pepper_drake.systems.framework import LeafSystem

Vector = npt.NDArray[np.float64]


def step_follower(
    state: Vector, target: Vector, *, time_constant: float, max_speed: float, time_step: float
) -> Vector:
    """Returns the state (2n,), position and velocity, one step closer to a target (n,).

    A critically damped second-order filter of frequency 2 / T whose desired velocity w is limited,
    v' = 4 / T (w - v), w = (target - x) / T, |w| <= max_speed.

    Args:
        state: Position and velocity (2n,).
        target: (n,).
        time_constant: T [s].
        max_speed: Largest norm of the velocity, in the coordinates' unit per s.
        time_step: At most T / 4 [s].
    """
    n = len(target)
    position, velocity = state[:n], state[n:]
    desired = (target - position) / time_constant
    desired *= min(1.0, max_speed / max(float(np.linalg.norm(desired)), 1e-12))
    velocity = velocity + 4.0 * time_step / time_constant * (desired - velocity)
    return np.concatenate((position + time_step * velocity, velocity))


class ReferenceFilter(LeafSystem):
    """Moves an object smoothly to a position set by a person; see `step_follower`.

    .. pydrake_system::

        name: ReferenceFilter
        input_ports:
        - target
        output_ports:
        - desired_state

    Input: `target` (n). Output: `desired_state` (2n), position and velocity, zero at the start.
    State: the same, at `time_step`.

    Args:
        size: Number n of coordinates.
        time_constant: [s].
        max_speed: Largest norm of the velocity, in the coordinates' unit per s.
        time_step: [s].
    """

    def __init__(
        self,
        size: int,
        *,
        time_constant: float = 0.2,
        max_speed: float = 0.3,
        time_step: float = 0.01,
    ) -> None:
        super().__init__()
        self._time_constant, self._max_speed = time_constant, max_speed
        self._time_step = time_step
        self.target_input: InputPort = self.DeclareVectorInputPort("target", size)
        self._state = self.DeclareDiscreteState(2 * size)
        self.desired_state_output: OutputPort = self.DeclareStateOutputPort(
            "desired_state", self._state
        )
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = step_follower(
            context.get_discrete_state(self._state).value(),
            self.target_input.Eval(context),
            time_constant=self._time_constant,
            max_speed=self._max_speed,
            time_step=self._time_step,
        )
        discrete_state.set_value(self._state, state)
