"""Injects a fault into one connection, or into several that belong together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiscreteValues,
    InputPort,
    PortDataType,
    State,
)

from pepper_drake.systems.faults.corruption import corrupt
from pepper_drake.systems.faults.fault import SIGNALS, Fault
from pepper_drake.systems.faults.fault_memory import (
    CORRUPTING,
    FaultMemory,
    Role,
    SignalNow,
    Values,
)
from pepper_drake.systems.framework import LeafSystem


@dataclass(frozen=True)
class _Memories:
    """The memory before and after the present tick, and the number of that tick.

    At a tick, Drake updates abstract state before discrete state. The signal must not change in
    between: a discrete update that reads it would see a value from after the tick.
    """

    before: FaultMemory
    after: FaultMemory
    number: int

    def __deepcopy__(self, memo: dict) -> "_Memories":
        """Returns itself: Drake copies the state at each event, and this never changes."""
        return self


class FaultInjector(LeafSystem):
    """Passes a signal through unchanged until the fault begins.

    Garbage, wrong, noisy and stuck affect the signal's values alone; off, slow, delayed and
    intermittent affect all its ports together: an image with its pose and its time stamp. While
    off, images, poses and clouds are frozen; vectors become NaN, or `neutral`.

    .. pydrake_system::

        name: FaultInjector
        input_ports:
        - (one for each of `ports`)
        - trigger (optional)
        - neutral (optional)
        output_ports:
        - (the same)

    Inputs: the ports of the signal; `trigger` (1), not zero once a fault without a start time
    begins; `neutral`, the value of a vector while it is off. Outputs: the signal's ports under the
    same names. State: a memory of past values (abstract) and the number of the present tick (1), at
    the signal's period. The outputs depend on inputs and state, not on time, and change together
    with discrete state.

    Args:
        fault: What fails, and when.
        ports: Name, role and model value of each port; the size of a vector port.
        elements: The elements of a vector that garbage, wrong, noisy and stuck may affect; one of
            them is drawn. All of them if omitted.
        seed: Random numbers follow from it and from the fault.
    """

    def __init__(
        self,
        fault: Fault,
        ports: Mapping[str, tuple[Role, int | AbstractValue]],
        *,
        elements: Sequence[int] | None = None,
        seed: int = 0,
    ) -> None:
        super().__init__()
        self.fault, self._signal = fault, SIGNALS[fault.signal]
        names = (*SIGNALS, fault.kind)
        self._seed = (seed, names.index(fault.signal), sum(map(ord, fault.kind)))
        self._roles = [role for role, _ in ports.values()]
        self._elements: list[int] | None = None
        if elements is not None:
            chosen = int(np.random.default_rng(self._seed).integers(len(elements)))
            self._elements = [list(elements)[chosen]]
        self._ports: list[InputPort] = []
        for name, (_, model) in ports.items():
            if isinstance(model, int):
                self._ports.append(self.DeclareVectorInputPort(name, model))
            else:
                self._ports.append(self.DeclareAbstractInputPort(name, model))
        self._trigger: InputPort = self.DeclareVectorInputPort("trigger", 1)
        first = next(iter(ports.values()))[1]
        self._neutral: InputPort | None = None
        if isinstance(first, int):
            self._neutral = self.DeclareVectorInputPort("neutral", first)
        self._memories = self.DeclareAbstractState(
            Value[object](_Memories(FaultMemory(), FaultMemory(), 0))
        )
        self._number = self.DeclareDiscreteState(1)
        state = {
            self.abstract_state_ticket(self._memories),
            self.discrete_state_ticket(self._number),
        }
        for k, (name, (_, model)) in enumerate(ports.items()):
            ready = {*state, self._ports[k].ticket()}
            if self._neutral is not None and k == 0:
                ready.add(self._neutral.ticket())
            self._declare_output(name, k, model, ready)
        self.DeclarePeriodicUnrestrictedUpdateEvent(self._signal.period, 0.0, self._update)
        self.DeclarePeriodicDiscreteUpdateEvent(self._signal.period, 0.0, self._count)

    def _declare_output(
        self, name: str, index: int, model: int | AbstractValue, ready: set[Any]
    ) -> None:
        if isinstance(model, int):

            def calc_vector(context: Context, output: BasicVector) -> None:
                output.SetFromVector(self._value(context, index))

            self.DeclareVectorOutputPort(name, model, calc_vector, prerequisites_of_calc=ready)
            return

        def calc(context: Context, output: AbstractValue) -> None:
            output.SetFrom(self._value(context, index))

        self.DeclareAbstractOutputPort(
            name, lambda: model.Clone(), calc, prerequisites_of_calc=ready
        )

    def _get(self, context: Context) -> FaultMemory:
        memories = context.get_abstract_state(int(self._memories)).get_value()
        number = context.get_discrete_state(self._number).value()[0]
        return memories.after if number == memories.number else memories.before

    def _input(self, context: Context, index: int) -> Any:
        port = self._ports[index]
        if port.get_data_type() == PortDataType.kVectorValued:
            return port.Eval(context)
        return self.EvalAbstractInput(context, port.get_index())

    def _inputs(self, context: Context) -> Values:
        values = (self._input(context, k) for k in range(len(self._ports)))
        return tuple(v.copy() if isinstance(v, np.ndarray) else v.Clone() for v in values)

    def _value(self, context: Context, index: int) -> Any:
        """Returns the present value of a port: an array, or an AbstractValue."""
        memory, kind, role = self._get(context), self.fault.kind, self._roles[index]
        value = self._input(context, index)
        if not memory.active:
            return value
        if kind in CORRUPTING:
            return self._corrupted(value, memory) if role == Role.VALUE else value
        is_number = isinstance(value, np.ndarray)
        if kind == "off":
            if role == Role.VALID:
                return np.zeros_like(value)
            if is_number and role == Role.VALUE:
                if self._neutral is not None and self._neutral.HasValue(context):
                    return self._neutral.Eval(context)
                return np.full_like(value, np.nan)
        if kind == "stuck" and role != Role.VALUE:
            return value
        assert memory.held is not None
        held = memory.held[index]
        if role == Role.AGE:
            return held + memory.lag
        if kind == "stuck" and is_number and self._elements is not None:
            mixed = value.copy()
            mixed[self._elements] = held[self._elements]
            return mixed
        return held

    def _corrupted(self, value: Any, memory: FaultMemory) -> Any:
        plain = value if isinstance(value, np.ndarray) else value.get_value()
        # Evaluating an image twice gives the same noise.
        number = memory.count
        result = corrupt(
            plain,
            self.fault.kind,
            self._signal,
            np.random.default_rng((*self._seed, number)),
            np.random.default_rng(self._seed),
            self._elements,
        )
        return result if isinstance(value, np.ndarray) else Value(result)

    def _update(self, context: Context, state: State) -> None:
        memory = self._get(context)
        number = int(context.get_discrete_state(self._number).value()[0])
        after = memory.advanced(self.fault, self._signal_now(context), self._seed)
        memories = _Memories(memory, after, number + 1)
        state.get_mutable_abstract_state(int(self._memories)).set_value(memories)

    def _count(self, context: Context, discrete_state: DiscreteValues) -> None:
        number = context.get_discrete_state(self._number).value()[0]
        discrete_state.set_value(self._number, [number + 1.0])

    def _signal_now(self, context: Context) -> SignalNow:
        stamps = (k for k, role in enumerate(self._roles) if role == Role.STAMP)
        stamp = next((float(self._input(context, k)[0]) for k in stamps), np.nan)
        triggered = self._trigger.HasValue(context) and self._trigger.Eval(context)[0] != 0.0
        return SignalNow(context.get_time(), stamp, triggered, lambda: self._inputs(context))
