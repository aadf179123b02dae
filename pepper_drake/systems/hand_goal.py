"""Where the hand should go: the pre-grasp pose at the goal object, in the torso frame."""

from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, InputPort, LeafSystem, ValueProducer


class HandGoal(LeafSystem):
    """X_TG = X_TW X_WO X_OG.

    .. pydrake_system::

        name: HandGoal
        input_ports:
        - object_pose
        - torso_pose
        output_ports:
        - goal_position
        - goal_orientation

    Inputs: `object_pose` X_WO and `torso_pose` X_WT, RigidTransform. Outputs: `goal_position` (3),
    m, and `goal_orientation` (4), unit quaternion w, x, y, z, of the hand's goal G in T.

    Args:
        X_OG: The hand's pre-grasp pose in the object frame.
    """

    def __init__(self, X_OG: RigidTransform) -> None:
        super().__init__()
        self._X_OG = X_OG
        self.object_pose_input: InputPort = self.DeclareAbstractInputPort(
            "object_pose", Value(RigidTransform())
        )
        self.torso_pose_input: InputPort = self.DeclareAbstractInputPort(
            "torso_pose", Value(RigidTransform())
        )
        self._X_TG = self.DeclareCacheEntry(
            "X_TG",
            ValueProducer(allocate=lambda: Value(RigidTransform()), calc=self._calc_X_TG),
            prerequisites_of_calc={
                self.object_pose_input.ticket(),
                self.torso_pose_input.ticket(),
            },
        )
        ready = {self._X_TG.ticket()}
        self.DeclareVectorOutputPort(
            "goal_position", 3, self._calc_position, prerequisites_of_calc=ready
        )
        self.DeclareVectorOutputPort(
            "goal_orientation", 4, self._calc_orientation, prerequisites_of_calc=ready
        )

    def _calc_X_TG(self, context: Context, X_TG: Value) -> None:
        X_WT = self.torso_pose_input.Eval(context)
        X_WO = self.object_pose_input.Eval(context)
        X_TG.set_value(X_WT.inverse() @ X_WO @ self._X_OG)

    def _calc_position(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._X_TG.Eval(context).translation())

    def _calc_orientation(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._X_TG.Eval(context).rotation().ToQuaternion().wxyz())
