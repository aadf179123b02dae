"""Drake's Selector of elements of vector ports."""

from collections.abc import Sequence

from pydrake.systems.framework import DiagramBuilder, OutputPort
from pydrake.systems.primitives import Selector, SelectorParams


def add_selector(
    builder: DiagramBuilder,
    name: str,
    sources: Sequence[OutputPort],
    elements: Sequence[tuple[int, int]],
) -> OutputPort:
    """Adds a Selector and returns its output.

    Args:
        builder: Of a diagram with the sources.
        name: The selector's.
        sources: Vector ports, connected to the inputs.
        elements: For each element of the output, the number of its source and its index there.
    """
    picked = [
        SelectorParams.OutputSelection(input_port_index=source, input_offset=index)
        for source, index in elements
    ]
    selector = builder.AddNamedSystem(
        name,
        Selector(
            SelectorParams(
                inputs=[SelectorParams.InputPortParams(size=port.size()) for port in sources],
                outputs=[SelectorParams.OutputPortParams(selections=picked)],
            )
        ),
    )
    for number, port in enumerate(sources):
        builder.Connect(port, selector.get_input_port(number))
    return selector.get_output_port()
