"""The pose of one of a plant's bodies."""

from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import Context, InputPort, OutputPort

from pepper_drake.systems.framework import LeafSystem


class BodyPose(LeafSystem):
    """Selects a body's pose X_WB from a plant's port `body_poses`.

    .. pydrake_system::

        name: BodyPose
        input_ports:
        - body_poses
        output_ports:
        - pose

    Args:
        index: Index of the body.
    """

    def __init__(self, index: BodyIndex) -> None:
        super().__init__()
        self._index = int(index)
        self.body_poses_input: InputPort = self.DeclareAbstractInputPort(
            "body_poses", Value([RigidTransform()])
        )
        self.pose_output: OutputPort = self.DeclareAbstractOutputPort(
            "pose",
            lambda: Value(RigidTransform()),
            self._calc_pose,
            {self.body_poses_input.ticket()},
        )

    def _calc_pose(self, context: Context, output: Value) -> None:
        output.set_value(self.body_poses_input.Eval(context)[self._index])
