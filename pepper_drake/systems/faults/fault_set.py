"""The faults of a run, injected into the connections of a diagram."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import DiagramBuilder, OutputPort, PortDataType

from pepper_drake.systems.faults.fault import SIGNALS, Fault
from pepper_drake.systems.faults.fault_injector import FaultInjector
from pepper_drake.systems.faults.fault_memory import Role


@dataclass(frozen=True)
class FaultSet:
    """The faults of a run, to be injected into the connections of a diagram.

    Attributes:
        faults: At most one for each signal.
        seed: Seed of their random numbers.
    """

    faults: tuple[Fault, ...] = ()
    seed: int = 0

    def fault(self, signal: str) -> Fault | None:
        """Returns the fault of a signal, if it has one."""
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
        """Injects the fault of a signal behind output ports.

        Args:
            builder: Builder of the diagram that contains the ports.
            signal: A name in SIGNALS.
            ports: The signal's ports by name, the value first.
            elements: Elements of a vector of which one fails; see `FaultInjector`.
            neutral: The value of a vector while it is off.
            suffix: Appended to the injector's name, for a signal with several injectors.

        Returns:
            The ports to connect instead, under the same names; the same ports without a fault. The
            caller connects the triggers of the `waiting` injectors.
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
