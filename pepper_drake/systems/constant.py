"""A value that never changes."""

import numpy as np
import numpy.typing as npt
from pydrake.common.value import AbstractValue

from pepper_drake.systems.framework import LeafSystem


class Constant(LeafSystem):
    """Outputs a constant value.

    Drake's constant sources depend on time, which invalidates everything computed from them.

    .. pydrake_system::

        name: Constant
        output_ports:
        - value

    Output: `value`, a vector (n) or the content of an abstract Value. No state.

    Args:
        value: Numbers (n,), or anything else wrapped in a Value.

    Examples:
        >>> source = Constant([1.0, 2.0])
        >>> print(source.get_output_port().Eval(source.CreateDefaultContext()))
        [1. 2.]
    """

    def __init__(self, value: npt.ArrayLike | AbstractValue) -> None:
        super().__init__()
        never = {self.nothing_ticket()}
        if isinstance(value, AbstractValue):
            self.DeclareAbstractOutputPort(
                "value", lambda: value.Clone(), lambda _, output: output.SetFrom(value), never
            )
        else:
            numbers = np.asarray(value, dtype=float)
            self.DeclareVectorOutputPort(
                "value", len(numbers), lambda _, output: output.SetFromVector(numbers), never
            )
