"""A fault between two ports, or between several that belong together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Any

import numpy as np
import numpy.typing as npt
from pydrake.common.value import AbstractValue, Value
from pydrake.systems.framework import (
    BasicVector,
    Context,
    DiagramBuilder,
    DiscreteValues,
    InputPort,
    OutputPort,
    PortDataType,
    State,
)

from pepper_drake.systems.faults.corruption import corrupt
from pepper_drake.systems.faults.fault import SIGNALS, Fault
from pepper_drake.systems.framework import LeafSystem

Vector = npt.NDArray[np.float64]
Values = tuple[Any, ...]

_CORRUPTING = ("garbage", "wrong", "noisy")


class Role(Enum):
    """Role of a port in a signal."""

    VALUE = "value"
    """The signal itself."""
    CARRIED = "carried"
    """Value that belongs to it: the pose of an image."""
    STAMP = "stamp"
    """The time of the value [s]: a new one tells that the value is new."""
    AGE = "age"
    """Time since the value was measured [s]: it grows while no new value comes."""
    VALID = "valid"
    """1 while there is a value."""


@dataclass(frozen=True)
class _Memory:
    """State of a fault. Never changed once made.

    Attributes:
        begun: When the fault began [s]; NaN before.
        active: Whether the signal fails now.
        count: Number of updates so far: it decides what is drawn.
        held: What came last, and is given instead of what comes.
        lag: How old that is by now [s].
        queue: What came, with its time, oldest first.
        stamp: Of what came last.
    """

    begun: float = np.nan
    active: bool = False
    count: int = 0
    held: Values | None = None
    lag: float = 0.0
    held_since: float = 0.0
    queue: tuple[tuple[float, Values], ...] = ()
    stamp: float = np.nan

    def __deepcopy__(self, memo: dict) -> "_Memory":
        """Returns itself: Drake copies the state at each event, and this never changes."""
        return self


@dataclass(frozen=True)
class _Memories:
    """The memory before and after the present tick, and the number of that tick.

    Abstract state changes before discrete state at the same tick. A signal may not change in
    between: who reads it in a discrete update would find another value than it had until then.
    """

    before: _Memory
    after: _Memory
    number: int

    def __deepcopy__(self, memo: dict) -> "_Memories":
        """Returns itself: Drake copies the state at each event, and this never changes."""
        return self


class FaultInjector(LeafSystem):
    """Passes a signal on, until it fails.

    Garbage, wrong, noisy and stuck concern the signal's values; off, slow, delayed and
    intermittent all that belongs together: an image with its pose and its stamp. A signal that is
    off gives no new images, poses and clouds; numbers become NaN, or `neutral`.

    .. pydrake_system::

        name: FaultInjector
        input_ports:
        - (as the ports that are connected)
        - trigger (optional)
        - neutral (optional)
        output_ports:
        - (the same)

    Inputs: the ports of the signal; `trigger` (1), not zero from the moment at which a fault
    without a time begins; `neutral`, what a vector is while it is off. Outputs: the signal's ports
    by the same names. State: a memory of what came (abstract) and the number of the tick from which
    on it counts (1), at the signal's period. The outputs depend on inputs and state, not on time,
    and change together with discrete state.

    Args:
        fault: What fails, and when.
        ports: Name, role and a model of the value of each port; vectors as a size.
        elements: The elements of a vector that may be concerned by garbage, wrong, noisy and
            stuck; one of them is drawn. All of them at once if left out.
        seed: What is drawn follows from it and from the fault.
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
            Value[object](_Memories(_Memory(), _Memory(), 0))
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

    def _get(self, context: Context) -> _Memory:
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
        """Present value of a port: an array, or an AbstractValue."""
        memory, kind, role = self._get(context), self.fault.kind, self._roles[index]
        value = self._input(context, index)
        if not memory.active:
            return value
        if kind in _CORRUPTING:
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

    def _corrupted(self, value: Any, memory: _Memory) -> Any:
        plain = value if isinstance(value, np.ndarray) else value.get_value()
        # An image's noise is its own, however often it is looked at.
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
        after = self._next(context, memory, context.get_time())
        memories = _Memories(memory, after, number + 1)
        state.get_mutable_abstract_state(int(self._memories)).set_value(memories)

    def _count(self, context: Context, discrete_state: DiscreteValues) -> None:
        number = context.get_discrete_state(self._number).value()[0]
        discrete_state.set_value(self._number, [number + 1.0])

    def _next(self, context: Context, memory: _Memory, time: float) -> _Memory:
        fault, kind = self.fault, self.fault.kind
        if np.isnan(memory.begun):
            begins = time >= fault.start - 1e-9
            if np.isnan(fault.start):
                begins = self._trigger.HasValue(context) and self._trigger.Eval(context)[0] != 0.0
            if begins:
                memory = replace(memory, begun=time)
        begun = not np.isnan(memory.begun)
        active = begun and time < memory.begun + fault.duration - 1e-9
        if kind == "delayed":
            memory = self._remembered(context, memory, time)
        if not active:
            return replace(memory, active=False) if memory.active else memory
        memory = replace(memory, active=True, count=memory.count + 1)
        if kind in _CORRUPTING:
            return memory
        if kind == "delayed":
            old = [entry for entry in memory.queue if entry[0] <= time - self._signal.delay + 1e-9]
            since, held = old[-1] if old else memory.queue[0]
            return replace(memory, held=held, lag=time - since)
        if memory.held is None or self._takes_new(context, memory, time):
            return replace(
                memory,
                held=self._inputs(context),
                held_since=time,
                lag=0.0,
                stamp=self._stamp(context),
            )
        return replace(memory, lag=time - memory.held_since, stamp=self._stamp(context))

    def _takes_new(self, context: Context, memory: _Memory, time: float) -> bool:
        """True if the present value is let through."""
        if self.fault.kind == "slow":
            return time >= memory.held_since + self._signal.slow_period - 1e-9
        if self.fault.kind == "intermittent":
            stamp = self._stamp(context)
            if stamp == memory.stamp:  # Not for NaN: a signal without stamps is always new.
                return False
            draw = np.random.default_rng((*self._seed, memory.count))
            return bool(draw.random() < 0.5)
        return False

    def _remembered(self, context: Context, memory: _Memory, time: float) -> _Memory:
        """The memory with what comes now in its queue."""
        stamp = self._stamp(context)
        if memory.queue and stamp == memory.stamp:
            return memory
        queue = (*memory.queue, (time, self._inputs(context)))
        # One that is old enough has to stay.
        while len(queue) > 1 and queue[1][0] <= time - self._signal.delay:
            queue = queue[1:]
        return replace(memory, queue=queue, stamp=stamp)

    def _stamp(self, context: Context) -> float:
        """The stamp of what comes now; NaN for a signal that has none."""
        for k, role in enumerate(self._roles):
            if role == Role.STAMP:
                return float(self._input(context, k)[0])
        return np.nan


@dataclass(frozen=True)
class FaultSet:
    """The faults of a run, to be put into the connections of a diagram.

    Attributes:
        faults: At most one for each signal.
        seed: What they draw follows from it.
    """

    faults: tuple[Fault, ...] = ()
    seed: int = 0

    def fault(self, signal: str) -> Fault | None:
        """The fault of a signal, if it has one."""
        assert signal in SIGNALS
        return next((fault for fault in self.faults if fault.signal == signal), None)

    def tap(
        self,
        builder: DiagramBuilder,
        signal: str,
        ports: Mapping[str, tuple[Role, OutputPort]],
        *,
        elements: Sequence[int] | None = None,
        neutral: OutputPort | None = None,
        suffix: str = "",
    ) -> dict[str, OutputPort]:
        """Puts the fault of a signal behind output ports.

        Args:
            builder: Of the diagram in which the ports are.
            signal: A name in SIGNALS.
            ports: The signal's ports by name, the value first.
            elements: Elements of a vector of which one fails; see `FaultInjector`.
            neutral: What a vector is while it is off.
            suffix: Of the injector's name, where a signal has several.

        Returns:
            The ports to connect instead, by the same names; without a fault the same ports. Who
            builds the diagram connects the triggers of those that are `waiting`.
        """
        fault = self.fault(signal)
        if fault is None:
            return {name: port for name, (_, port) in ports.items()}
        models = {
            name: (
                role,
                port.size()
                if port.get_data_type() == PortDataType.kVectorValued
                else port.Allocate(),
            )
            for name, (role, port) in ports.items()
        }
        injector = builder.AddNamedSystem(
            f"fault_{signal}{suffix}",
            FaultInjector(fault, models, elements=elements, seed=self.seed),
        )
        for name, (_, port) in ports.items():
            builder.Connect(port, injector.GetInputPort(name))
        if neutral is not None:
            builder.Connect(neutral, injector.GetInputPort("neutral"))
        return {name: injector.GetOutputPort(name) for name in ports}

    def waiting(self, builder: DiagramBuilder) -> list[FaultInjector]:
        """The injectors among a builder's systems that wait for the arm to start."""
        return [
            system
            for system in builder.GetMutableSystems()
            if isinstance(system, FaultInjector) and np.isnan(system.fault.start)
        ]
