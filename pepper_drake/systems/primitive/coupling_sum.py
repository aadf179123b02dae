"""The sum of coupling terms and of slowdowns."""

from functools import partial

import numpy as np
from pydrake.systems.framework import BasicVector, Context, InputPort

from pepper_drake.systems.framework import LeafSystem


class CouplingSum(LeafSystem):
    """Adds up couplings; each input is optional.

    .. pydrake_system::

        name: CouplingSum
        input_ports:
        - slowdown_0 (optional)
        - coupling_0 (optional)
        - ...
        output_ports:
        - slowdown
        - coupling

    Inputs and outputs: `slowdown` (1) >= 0 for a CanonicalSystem, `coupling` (3) [m] for a
    TransformationSystem. No state.

    Examples:
        >>> total = CouplingSum(2)
        >>> context = total.CreateDefaultContext()
        >>> _ = total.GetInputPort("coupling_1").FixValue(context, [0.0, 0.0, 0.5])
        >>> print(total.GetOutputPort("coupling").Eval(context))
        [0.  0.  0.5]
    """

    def __init__(self, count: int) -> None:
        """Makes the system.

        Args:
            count: Number of couplings.
        """
        super().__init__()
        for name, size in (("slowdown", 1), ("coupling", 3)):
            terms = [self.DeclareVectorInputPort(f"{name}_{k}", size) for k in range(count)]
            self.DeclareVectorOutputPort(
                name, size, partial(self._calc, terms), {term.ticket() for term in terms}
            )

    def _calc(self, terms: list[InputPort], context: Context, output: BasicVector) -> None:
        values = [term.Eval(context) for term in terms if term.HasValue(context)]
        output.SetFromVector(
            values[0] if len(values) == 1 else sum(values, np.zeros(output.size()))
        )
