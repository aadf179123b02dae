"""The arm's posture along the primitive: what the inverse kinematics leans towards."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt
from pydrake.systems.framework import BasicVector, Context, InputPort, LeafSystem

Vector = npt.NDArray[np.float64]


class NominalPosture(LeafSystem):
    """Joint angles as a function of the phase.

    .. pydrake_system::

        name: NominalPosture
        input_ports:
        - phase
        output_ports:
        - joint_position

    Input: `phase` (1), 1 at the start of the motion and falling. Output: `joint_position` (5), rad.

    Args:
        posture: From a phase to the arm's five joint angles (5,), rad.
    """

    def __init__(self, posture: Callable[[float], Vector]) -> None:
        super().__init__()
        self._posture = posture
        self.phase_input: InputPort = self.DeclareVectorInputPort("phase", 1)
        self.DeclareVectorOutputPort(
            "joint_position",
            5,
            self._calc_posture,
            prerequisites_of_calc={self.phase_input.ticket()},
        )

    def _calc_posture(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._posture(float(self.phase_input.Eval(context)[0])))
