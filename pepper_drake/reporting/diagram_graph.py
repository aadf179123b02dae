"""Graph of the connections in a Drake diagram."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from pydrake.systems.framework import Diagram, System
from pydrake.systems.primitives import Demultiplexer, MatrixGain, Multiplexer, PassThrough, Selector

INPUTS, OUTPUTS = "inputs", "outputs"
"""Names of the two nodes for the diagram's own ports."""

_PLUMBING = (MatrixGain, Multiplexer, Demultiplexer, PassThrough, Selector)
"""Systems that only rearrange a vector's elements; drawn as arrows, not as nodes."""

_Port = tuple[str, str]
"""A node's name and the name of one of its output ports."""


@dataclass
class Node:
    """A system, or the diagram's own inputs or outputs.

    Attributes:
        name: The system's name; "diagram/name" in an expanded diagram.
        kind: Name of the class; empty for the diagram's own ports.
        own: Whether the class is from this project, not from Drake.
        signals: Names of connected output ports.
    """

    name: str
    kind: str = ""
    own: bool = False
    signals: list[str] = field(default_factory=list)


@dataclass
class DiagramGraph:
    """The nodes and connections of a diagram.

    Attributes:
        nodes: Nodes by name: first those that only send, then the others in the diagram's order.
        edges: Unique pairs (sender, receiver) of names.
    """

    nodes: dict[str, Node]
    edges: list[tuple[str, str]]


def make_diagram_graph(diagram: Diagram, depth: int = 1) -> DiagramGraph:
    """Makes a graph of a diagram.

    Loggers are omitted, as are systems that only select or rearrange elements of a vector: their
    signals are drawn from the system that computes them.

    Args:
        diagram: The diagram.
        depth: 1 for the diagram's subsystems, 2 to expand those that are diagrams, and so on.
    """
    reader = _Reader(diagram, depth)
    nodes: dict[str, Node] = {}
    if diagram.num_input_ports():
        nodes[INPUTS] = Node(INPUTS)
    for name, system in reader.leaves.items():
        if not isinstance(system, _PLUMBING) and not _is_logger(system):
            own = type(system).__module__.startswith("pepper_drake")
            nodes[name] = Node(name, _class_name(system), own)
    if diagram.num_output_ports():
        nodes[OUTPUTS] = Node(OUTPUTS)
    edges: dict[tuple[str, str], None] = {}
    for receiver in nodes:
        for sender, signal in reader.sources_of(receiver):
            edges[sender, receiver] = None
            if signal not in nodes[sender].signals:
                nodes[sender].signals.append(signal)
    senders, receivers = {a for a, _ in edges}, {b for _, b in edges}
    first = [name for name in nodes if name in senders - receivers]
    then = [name for name in nodes if name in receivers]
    return DiagramGraph({name: nodes[name] for name in (*first, *then)}, list(edges))


def _class_name(system: System) -> str:
    """Returns a class's name without the scalar type that pydrake appends to template classes."""
    return re.sub(r"_[^\x00-\x7f].*", "", type(system).__name__)


def _is_logger(system: System) -> bool:
    return type(system).__name__.startswith("VectorLogSink")


class _Reader:
    """Follows connections through plumbing and into and out of nested diagrams."""

    def __init__(self, diagram: Diagram, depth: int) -> None:
        self._diagram = diagram
        self.leaves: dict[str, System] = {}
        self._names: dict[System, str] = {}
        self._parents: dict[System, Diagram] = {}
        self._sources: dict[tuple[System, int], tuple[System, int]] = {}
        self._opened: set[System] = {diagram}
        self._open(diagram, "", depth)

    def _open(self, diagram: Diagram, prefix: str, depth: int) -> None:
        for receiver, sender in diagram.connection_map().items():
            self._sources[receiver[0], int(receiver[1])] = (sender[0], int(sender[1]))
        for system in diagram.GetSystems():
            name = prefix + system.get_name()
            self._parents[system] = diagram
            if isinstance(system, Diagram) and depth > 1:
                self._opened.add(system)
                self._open(system, f"{name}/", depth - 1)
            else:
                self.leaves[name] = system
                self._names[system] = name
        for k in range(diagram.num_input_ports()):
            port = diagram.get_input_port(k)
            for system, index in diagram.GetInputPortLocators(port.get_index()):
                self._sources[system, int(index)] = (diagram, -1 - k)

    def sources_of(self, receiver: str) -> Iterator[_Port]:
        """Yields the nodes and output ports that send to a node."""
        if receiver == INPUTS:
            return
        if receiver == OUTPUTS:
            for k in range(self._diagram.num_output_ports()):
                yield from self._at_output(self._diagram, k)
            return
        yield from self._at_inputs(self.leaves[receiver])

    def _at_inputs(self, system: System) -> Iterator[_Port]:
        for k in range(system.num_input_ports()):
            yield from self._at_input(system, k)

    def _at_input(self, system: System, index: int) -> Iterator[_Port]:
        source = self._sources.get((system, index))
        if source is None:
            return
        sender, port = source
        if port >= 0:
            yield from self._at_output(sender, port)
        elif sender is self._diagram:
            yield INPUTS, sender.get_input_port(-1 - port).get_name()
        else:
            yield from self._at_input(sender, -1 - port)

    def _at_output(self, system: System, index: int) -> Iterator[_Port]:
        if system in self._opened:
            port = system.get_output_port(index).get_index()
            inner, number = system.get_output_port_locator(port)
            yield from self._at_output(inner, int(number))
        elif isinstance(system, _PLUMBING):
            yield from self._at_inputs(system)
        else:
            yield self._names[system], system.get_output_port(index).get_name()
