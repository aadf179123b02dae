import numpy as np
import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import (
    Adder,
    ConstantVectorSource,
    Gain,
    Integrator,
    LogVectorOutput,
    MatrixGain,
    Multiplexer,
)
from pydrake.trajectories import PiecewisePolynomial

from pepper_drake.reporting.diagram_graph import INPUTS, OUTPUTS, make_diagram_graph
from pepper_drake.systems.robot.triggered_trajectory import TriggeredTrajectory


def inner_loop():
    """An integrator fed back to an adder, with a port in and a port out."""
    builder = DiagramBuilder()
    adder = builder.AddNamedSystem("adder", Adder(2, 1))
    state = builder.AddNamedSystem("state", Integrator(1))
    builder.Connect(adder.get_output_port(), state.get_input_port())
    builder.Connect(state.get_output_port(), adder.get_input_port(1))
    builder.ExportInput(adder.get_input_port(0), "wish")
    builder.ExportOutput(state.get_output_port(), "value")
    diagram = builder.Build()
    diagram.set_name("loop")
    return diagram


def outer():
    builder = DiagramBuilder()
    loop = builder.AddSystem(inner_loop())
    source = builder.AddNamedSystem("source", ConstantVectorSource([1.0]))
    sorter = builder.AddNamedSystem("sorter", MatrixGain(D=np.eye(1)))
    joined = builder.AddNamedSystem("joined", Multiplexer(2))
    gain = builder.AddNamedSystem("gain", Gain(2.0, 2))
    builder.AddNamedSystem("lonely", Gain(1.0, 1))
    builder.Connect(source.get_output_port(), sorter.get_input_port())
    builder.Connect(sorter.get_output_port(), loop.get_input_port())
    builder.Connect(loop.get_output_port(), joined.get_input_port(0))
    builder.Connect(source.get_output_port(), joined.get_input_port(1))
    builder.Connect(joined.get_output_port(), gain.get_input_port())
    LogVectorOutput(gain.get_output_port(), builder)
    builder.ExportOutput(gain.get_output_port(), "double")
    return builder.Build()


def test_arrows_go_through_what_only_sorts_and_loggers_are_left_out():
    graph = make_diagram_graph(outer())
    assert set(graph.edges) == {
        ("source", "loop"),
        ("loop", "gain"),
        ("source", "gain"),
        ("gain", OUTPUTS),
    }
    assert set(graph.nodes) == {"source", "loop", "gain", OUTPUTS}
    assert next(iter(graph.nodes)) == "source", "what only sends comes first"


def test_a_nested_diagram_is_opened_at_its_depth():
    graph = make_diagram_graph(outer(), depth=2)
    assert set(graph.edges) == {
        ("source", "loop/adder"),
        ("loop/adder", "loop/state"),
        ("loop/state", "loop/adder"),
        ("loop/state", "gain"),
        ("source", "gain"),
        ("gain", OUTPUTS),
    }
    assert make_diagram_graph(outer(), depth=7) == graph


def test_the_diagrams_own_ports_are_nodes():
    graph = make_diagram_graph(inner_loop())
    assert (INPUTS, "adder") in graph.edges
    assert ("state", OUTPUTS) in graph.edges
    assert graph.nodes[INPUTS].signals == ["wish"]


def test_signals_are_the_outputs_in_use_each_once():
    graph = make_diagram_graph(outer())
    assert graph.nodes["loop"].signals == ["value"]
    assert graph.nodes["source"].signals == ["y0"]
    assert graph.nodes[OUTPUTS].signals == []


@pytest.mark.parametrize("name", ["gain", "path"])
def test_classes_are_named_and_told_apart_by_whose_they_are(name):
    builder = DiagramBuilder()
    path = PiecewisePolynomial.FirstOrderHold([0.0, 1.0], np.array([[0.0, 1.0]]))
    triggered = builder.AddNamedSystem("path", TriggeredTrajectory(path))
    gain = builder.AddNamedSystem("gain", Gain(1.0, 2))
    builder.Connect(triggered.get_output_port(), gain.get_input_port())
    node = make_diagram_graph(builder.Build()).nodes[name]
    assert (node.kind, node.own) == {
        "gain": ("Gain", False),
        "path": ("TriggeredTrajectory", True),
    }[name]
