"""A value that never changes."""

import numpy as np
import numpy.typing as npt
from pydrake.common.value import AbstractValue

from pepper_drake.systems.framework import LeafSystem


class Constant(LeafSystem):
    """Gives the same value at all times.

    Drake's constant sources count as changed with time, and with them all that is computed of them.

    .. pydrake_system::

        name: Constant
        output_ports:
        - value

    Output: `value`, a vector (n) or what is in an abstract Value. No state.

    Args:
        value: Numbers (n,), or any other as a Value.

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
