"""A pose as vectors, for systems that compute with positions and quaternions."""

from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, InputPort

from pepper_drake.systems.framework import LeafSystem


class PoseVectors(LeafSystem):
    """Splits a pose into position and orientation.

    .. pydrake_system::

        name: PoseVectors
        input_ports:
        - pose
        output_ports:
        - position
        - orientation

    Input: `pose`, RigidTransform. Outputs: `position` (3) [m]; `orientation` (4), unit quaternion
    w, x, y, z. No state.
    """

    def __init__(self) -> None:
        super().__init__()
        self.pose_input: InputPort = self.DeclareAbstractInputPort("pose", Value(RigidTransform()))
        source = {self.pose_input.ticket()}
        self.DeclareVectorOutputPort("position", 3, self._calc_position, source)
        self.DeclareVectorOutputPort("orientation", 4, self._calc_orientation, source)

    def _calc_position(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self.pose_input.Eval(context).translation())

    def _calc_orientation(self, context: Context, output: BasicVector) -> None:
        rotation = self.pose_input.Eval(context).rotation()
        output.SetFromVector(rotation.ToQuaternion().wxyz())
