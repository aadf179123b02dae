"""Rejects impossible measurements at the input."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort

from pepper_drake.systems.framework import LeafSystem


class MeasurementGuard(LeafSystem):
    """Passes a measured vector through; impossible elements keep their last possible values.

    An element is impossible if it is not finite, or outside its range.

    .. pydrake_system::

        name: MeasurementGuard
        input_ports:
        - measured
        output_ports:
        - measured
        - age
        - missing

    Input: `measured` (n). Outputs: `measured` (n), each element the present one if possible, else
    the last possible one; `age` (1), time since all were possible at a tick [s], 0 while they are;
    `missing` (1), the index of the first impossible element, or -1.
    State: the last possible values (n), their age and the index (n + 2), at `time_step`.

    Args:
        start: Values before the first measurement (n,).
        lower: Smallest possible values (n,).
        upper: Largest possible values (n,).
        time_step: Period at which values are stored [s].
    """

    def __init__(
        self,
        start: npt.ArrayLike,
        *,
        lower: npt.ArrayLike = -np.inf,
        upper: npt.ArrayLike = np.inf,
        time_step: float = 0.02,
    ) -> None:
        super().__init__()
        # Finite limits, so that infinite values are rejected like NaN.
        self._lower, self._upper = np.nan_to_num(lower), np.nan_to_num(upper)
        first = np.atleast_1d(np.asarray(start, dtype=float))
        n = len(first)
        self._size, self._time_step = n, time_step
        self.measured_input: InputPort = self.DeclareVectorInputPort("measured", n)
        self._state = self.DeclareDiscreteState(np.concatenate((first, [0.0, -1.0])))
        state = self.discrete_state_ticket(self._state)
        self.DeclareVectorOutputPort(
            "measured",
            n,
            self._calc_measured,
            prerequisites_of_calc={state, self.measured_input.ticket()},
        )
        for name, index in (("age", n), ("missing", n + 1)):
            self._declare_part(name, index)
        self.DeclareInitializationDiscreteUpdateEvent(self._update)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _declare_part(self, name: str, index: int) -> None:
        def calc(context: Context, output: BasicVector) -> None:
            output.SetAtIndex(0, context.get_discrete_state(self._state).value()[index])

        self.DeclareVectorOutputPort(
            name, 1, calc, prerequisites_of_calc={self.discrete_state_ticket(self._state)}
        )

    def _are_possible(self, measured: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        return np.asarray((measured >= self._lower) & (measured <= self._upper))

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        state = context.get_discrete_state(self._state).value().copy()
        measured = self.measured_input.Eval(context)
        possible = self._are_possible(measured)
        if possible.all():
            state[: self._size] = measured
            state[self._size :] = 0.0, -1.0
        else:
            state[: self._size][possible] = measured[possible]
            state[self._size] += self._time_step
            state[self._size + 1] = float(np.argmin(possible))
        discrete_state.set_value(self._state, state)

    def _calc_measured(self, context: Context, output: BasicVector) -> None:
        measured = self.measured_input.Eval(context)
        possible = self._are_possible(measured)
        if not possible.all():
            last = context.get_discrete_state(self._state).value()[: self._size]
            measured = np.where(possible, measured, last)
        output.SetFromVector(measured)


class MeasurementAges(LeafSystem):
    """Joins the ages of measurements into one vector, recomputed only when one changes.

    Drake's Multiplexer depends on time as well, which invalidates everything computed from it.

    .. pydrake_system::

        name: MeasurementAges
        input_ports:
        - age_0
        - age_1
        output_ports:
        - age

    Inputs: `age_0` and `age_1` (1), of `MeasurementGuard`s [s]. Output: `age` (2) [s].
    """

    def __init__(self) -> None:
        super().__init__()
        self._ages: list[InputPort] = [self.DeclareVectorInputPort(f"age_{k}", 1) for k in range(2)]
        self.DeclareVectorOutputPort(
            "age", 2, self._calc_age, prerequisites_of_calc={port.ticket() for port in self._ages}
        )

    def _calc_age(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([port.Eval(context)[0] for port in self._ages])
