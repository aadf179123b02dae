"""Goal pose of the hand: the pre-grasp pose at the goal object, in the torso frame."""

from functools import partial

import numpy as np
import numpy.typing as npt
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, DiscreteValues, InputPort

from pepper_drake.systems.framework import LeafSystem, ValueProducer

Vector = npt.NDArray[np.float64]

_TOLERANCE = 5e-5
"""Pose changes up to this in every element (m, or quaternion components) are ignored."""


class HandGoalPose(LeafSystem):
    """X_TG = X_TO X_OG, with X_TO = X_TW X_WO held over a tick of the controller.

    The torso's measured pose changes at every step of the plant, if only in its last digits. X_TO
    is therefore kept until the object has moved by a twentieth of a millimetre, which keeps what is
    computed from it cached. X_OG is not held: a movement and its goal begin together. A movement
    that does not lead to the object has a fixed X_TG instead.

    .. pydrake_system::

        name: HandGoalPose
        input_ports:
        - object_pose
        - torso_pose
        - movement
        output_ports:
        - goal_position
        - goal_orientation

    Inputs: `object_pose` X_WO and `torso_pose` X_WT, RigidTransform; `movement`, abstract Movement,
    whose X_OG or X_TG is fed through. Outputs: `goal_position` (3) [m], and `goal_orientation` (4),
    unit quaternion w, x, y, z, of the hand's goal G in T.
    State: X_TO, position and quaternion (7), at `time_step`; the identity before initialization.

    Args:
        time_step: [s].

    Examples:
        >>> from pydrake.systems.analysis import Simulator
        >>> from pepper_drake.planning.reach.movement import Movement
        >>> system = HandGoalPose()
        >>> simulator = Simulator(system)
        >>> context = simulator.get_mutable_context()
        >>> movement = Movement(None, X_OG=RigidTransform([-0.1, 0.0, 0.05]))
        >>> _ = system.movement_input.FixValue(context, Value[object](movement))
        >>> X_WO, X_WT = RigidTransform([0.5, 0.0, 0.9]), RigidTransform([0.0, 0.0, 0.8])
        >>> _ = system.object_pose_input.FixValue(context, X_WO)
        >>> _ = system.torso_pose_input.FixValue(context, X_WT)
        >>> _ = simulator.AdvanceTo(0.1)
        >>> print(system.GetOutputPort("goal_position").Eval(context).round(3))
        [0.4  0.   0.15]
    """

    def __init__(self, *, time_step: float = 0.01) -> None:
        super().__init__()
        self.object_pose_input: InputPort = self.DeclareAbstractInputPort(
            "object_pose", Value(RigidTransform())
        )
        self.torso_pose_input: InputPort = self.DeclareAbstractInputPort(
            "torso_pose", Value(RigidTransform())
        )
        self.movement_input: InputPort = self.DeclareAbstractInputPort(
            "movement", Value[object](None)
        )
        self._object = self.DeclareDiscreteState(_numbers(RigidTransform()))
        self._goal = self.DeclareCacheEntry(
            "goal",
            ValueProducer(allocate=lambda: Value[object](np.zeros(7)), calc=self._calc_goal),
            prerequisites_of_calc={
                self.discrete_state_ticket(self._object),
                self.movement_input.ticket(),
            },
        )
        for name, size, part in (
            ("goal_position", 3, slice(0, 3)),
            ("goal_orientation", 4, slice(3, 7)),
        ):
            self.DeclareVectorOutputPort(
                name, size, partial(self._calc_part, part), {self._goal.ticket()}
            )
        self.DeclareInitializationDiscreteUpdateEvent(self._update)
        self.DeclarePeriodicDiscreteUpdateEvent(time_step, 0.0, self._update)

    def _calc_goal(self, context: Context, value: Value) -> None:
        state = context.get_discrete_state(self._object).value()
        X_TO = RigidTransform(Quaternion(wxyz=state[3:]), state[:3])
        value.set_value(_numbers(self.movement_input.Eval(context).hand_goal(X_TO)))

    def _calc_part(self, part: slice, context: Context, output: BasicVector) -> None:
        output.SetFromVector(self._goal.Eval(context)[part])

    def _update(self, context: Context, discrete_state: DiscreteValues) -> None:
        X_WT = self.torso_pose_input.Eval(context)
        now = _numbers(X_WT.InvertAndCompose(self.object_pose_input.Eval(context)))
        before = context.get_discrete_state(self._object).value()
        if np.abs(now - before).max() > _TOLERANCE:
            discrete_state.set_value(self._object, now)


def _numbers(X: RigidTransform) -> Vector:
    """Returns position [m] and quaternion w, x, y, z of a pose (7,)."""
    return np.concatenate((X.translation(), X.rotation().ToQuaternion().wxyz()))
