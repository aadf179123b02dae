"""The arm's posture along the primitive: what the inverse kinematics leans towards."""

import numpy as np
from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, InputPort

from pepper_drake.errors import InputError
from pepper_drake.learning import MovementPrimitive
from pepper_drake.learning.phase import relative_time_at
from pepper_drake.systems.framework import LeafSystem


class NominalPosture(LeafSystem):
    """A primitive's joint angles as a function of its phase.

    .. pydrake_system::

        name: NominalPosture
        input_ports:
        - phase
        - primitive (optional)
        output_ports:
        - joint_position

    Inputs: `phase` (1), 1 at the start of the motion and falling; `primitive`, abstract
    MovementPrimitive, in place of the one that the system was made with. Output: `joint_position`
    (J) [rad].

    Args:
        primitive: With a posture.

    Raises:
        InputError: It has none.
    """

    def __init__(self, primitive: MovementPrimitive) -> None:
        super().__init__()
        if primitive.posture is None:
            raise InputError(
                f"{primitive.name}: the primitive has no posture; learn it from a demonstration "
                "with joints"
            )
        self._primitive = primitive
        self.phase_input: InputPort = self.DeclareVectorInputPort("phase", 1)
        self.primitive_input: InputPort = self.DeclareAbstractInputPort(
            "primitive", Value[object](primitive)
        )
        self.DeclareVectorOutputPort(
            "joint_position",
            primitive.posture.at(np.zeros(1)).shape[1],
            self._calc_posture,
            prerequisites_of_calc={self.phase_input.ticket(), self.primitive_input.ticket()},
        )

    def _calc_posture(self, context: Context, output: BasicVector) -> None:
        primitive = self._primitive
        if self.primitive_input.HasValue(context):
            primitive = self.primitive_input.Eval(context)
        assert primitive.posture is not None
        time = relative_time_at(self.phase_input.Eval(context), primitive.translation.alpha_x)
        output.SetFromVector(primitive.posture.at(time)[0])
