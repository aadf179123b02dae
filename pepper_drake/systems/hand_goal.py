"""Where the hand should go: the pre-grasp pose at the goal object, in the torso frame."""

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, DiscreteValues, InputPort, LeafSystem

_STILL = 5e-5
"""Changes up to this in all numbers of the goal (m and parts of a quaternion) are none."""


class HandGoal(LeafSystem):
    """X_TG = X_TW X_WO X_OG, held over a tick of the controller.

    The torso's measured pose changes at every step of the plant, if only in its last digits; a
    goal that has not moved by a twentieth of a millimetre stays as it is, and with it all that is
    computed from it.

    .. pydrake_system::

        name: HandGoal
        input_ports:
        - object_pose
        - torso_pose
        - X_OG (optional)
        output_ports:
        - goal_position
        - goal_orientation

    Inputs: `object_pose` X_WO, `torso_pose` X_WT and `X_OG`, RigidTransform; the last is used in
    place of the one that the system was made with. Outputs: `goal_position` (3),
    m, and `goal_orientation` (4), unit quaternion w, x, y, z, of the hand's goal G in T.
    State: both, at `time_step`; the identity before initialization.

    Args:
        X_OG: The hand's pre-grasp pose in the object frame.
        time_step: s.
    """

    def __init__(self, X_OG: RigidTransform, *, time_step: float = 0.01) -> None:
        super().__init__()
        self._X_OG = X_OG
        self.object_pose_input: InputPort = self.DeclareAbstractInputPort(
            "object_pose", Value(RigidTransform())
        )
        self.torso_pose_input: InputPort = self.DeclareAbstractInputPort(
            "torso_pose", Value(RigidTransform())
        )
        self.X_OG_input: InputPort = self.DeclareAbstractInputPort("X_OG", Value(X_OG))
        self._position = self.DeclareDiscreteState(3)
        self._orientation = self.DeclareDiscreteState([1.0, 0.0, 0.0, 0.0])
        self.DeclareStateOutputPort("goal_position", self._position)
        self.DeclareStateOutputPort("goal_orientation", self._orientation)
        self.DeclareInitializationDiscreteUpdateEvent(self._update)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        X_WT = self.torso_pose_input.Eval(context)
        given = self.X_OG_input.HasValue(context)
        X_OG = self.X_OG_input.Eval(context) if given else self._X_OG
        X_TG = X_WT.InvertAndCompose(self.object_pose_input.Eval(context)) @ X_OG
        goal = (X_TG.translation(), X_TG.rotation().ToQuaternion().wxyz())
        states = (self._position, self._orientation)
        before = [context.get_discrete_state(state).value() for state in states]
        if np.abs(np.concatenate(goal) - np.concatenate(before)).max() > _STILL:
            for state, value in zip(states, goal, strict=True):
                discrete_state.set_value(state, value)
