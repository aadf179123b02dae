from dataclasses import dataclass, field

import numpy as np
import pytest
from pydrake.common.value import AbstractValue, Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import PortDataType


def _plain(value):
    """A port's value as something that compares with ==."""
    if isinstance(value, RigidTransform):
        return value.GetAsMatrix34().tolist()
    if isinstance(value, np.ndarray):
        return value.tolist()
    return value


def _fix(port, context, value):
    abstract = port.get_data_type() == PortDataType.kAbstractValued
    if abstract and not isinstance(value, AbstractValue):
        value = Value(value)
    port.FixValue(context, value)


@dataclass
class Ports:
    """A system's ports seen from outside: what its outputs are for given inputs."""

    system: object
    read: dict = field(default_factory=dict)
    """For an output's name, what makes its value comparable."""

    def fix(self, context, inputs):
        for name, value in inputs.items():
            _fix(self.system.GetInputPort(name), context, value)

    def outputs(self, context):
        system = self.system
        ports = [system.get_output_port(k) for k in range(system.num_output_ports())]
        return {
            port.get_name(): self.read.get(port.get_name(), _plain)(port.Eval(context))
            for port in ports
        }

    def changes(self, first, second):
        """Changes one input after another in a context whose outputs are already cached.

        Each output must be what a context gives that never knew the first value.

        Returns:
            The pairs (input, output) of which the second changed with the first.
        """
        changed = set()
        for name in first:
            used = self.system.CreateDefaultContext()
            self.fix(used, first)
            before = self.outputs(used)
            self.fix(used, {name: second[name]})
            fresh = self.system.CreateDefaultContext()
            self.fix(fresh, {**first, name: second[name]})
            after = self.outputs(fresh)
            assert self.outputs(used) == after, f"stale after {name} changed"
            changed |= {(name, output) for output in after if after[output] != before[output]}
        return changed

    def feedthrough(self):
        """The pairs (input, output) that the system declares to be direct feed-through."""
        system = self.system
        return {
            (system.get_input_port(i).get_name(), system.get_output_port(o).get_name())
            for i in range(system.num_input_ports())
            for o in range(system.num_output_ports())
            if system.HasDirectFeedthrough(i, o)
        }


@pytest.fixture
def ports():
    """Looks at a system's ports from outside."""
    return Ports
