import pytest
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource, PassThrough

from pepper_drake.diagrams.compliance import connect_couplings


def acting(builder, slowdown, coupling):
    """A system with the two outputs of what acts on a movement."""
    inner = DiagramBuilder()
    for name, value in (("slowdown", [slowdown]), ("coupling", coupling)):
        source = inner.AddSystem(ConstantVectorSource(value))
        inner.ExportOutput(source.get_output_port(), name)
    return builder.AddSystem(inner.Build())


def target(builder, name, size):
    inner = DiagramBuilder()
    through = inner.AddSystem(PassThrough(size))
    inner.ExportInput(through.get_input_port(), name)
    inner.ExportOutput(through.get_output_port(), "seen")
    return builder.AddSystem(inner.Build())


@pytest.mark.parametrize("count", [1, 2, 3])
def test_all_that_acts_is_added_up(count):
    builder = DiagramBuilder()
    systems = [acting(builder, 0.5 + k, [1.0 * k, 2.0, 0.0]) for k in range(count)]
    canonical, translation = target(builder, "slowdown", 1), target(builder, "coupling", 3)
    sums = connect_couplings(builder, systems, canonical, translation)
    assert sorted(sums) == ["coupling", "slowdown"]
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    seen = {
        system: system.GetOutputPort("seen").Eval(system.GetMyContextFromRoot(context))
        for system in (canonical, translation)
    }
    numbers = range(count)
    assert seen[canonical] == pytest.approx([sum(0.5 + k for k in numbers)])
    assert seen[translation] == pytest.approx([sum(numbers), 2.0 * count, 0.0])


def test_where_nothing_acts_nothing_is_connected():
    builder = DiagramBuilder()
    canonical, translation = target(builder, "slowdown", 1), target(builder, "coupling", 3)
    assert connect_couplings(builder, [], canonical, translation) == {}
