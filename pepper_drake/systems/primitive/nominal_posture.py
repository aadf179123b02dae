"""The arm's nominal posture along the primitive, towards which the inverse kinematics tends."""

from pydrake.common.value import Value
from pydrake.systems.framework import BasicVector, Context, InputPort

from pepper_drake.learning.phase import relative_time_at
from pepper_drake.systems.framework import LeafSystem


class NominalPosture(LeafSystem):
    """A primitive's joint angles as a function of its phase.

    .. pydrake_system::

        name: NominalPosture
        input_ports:
        - phase
        - movement
        output_ports:
        - joint_position

    Inputs: `phase` (1), decreasing from 1 at the start of the motion; `movement`, abstract Movement
    with a posture. Output: `joint_position` (J) [rad].

    Args:
        num_joints: Number J of joints.
    """

    def __init__(self, num_joints: int = 5) -> None:
        super().__init__()
        self.phase_input: InputPort = self.DeclareVectorInputPort("phase", 1)
        self.movement_input: InputPort = self.DeclareAbstractInputPort(
            "movement", Value[object](None)
        )
        self.DeclareVectorOutputPort(
            "joint_position",
            num_joints,
            self._calc_posture,
            prerequisites_of_calc={self.phase_input.ticket(), self.movement_input.ticket()},
        )

    def _calc_posture(self, context: Context, output: BasicVector) -> None:
        primitive = self.movement_input.Eval(context).primitive
        assert primitive.posture is not None
        time = relative_time_at(self.phase_input.Eval(context), primitive.translation.alpha_x)
        output.SetFromVector(primitive.posture.at(time)[0])
