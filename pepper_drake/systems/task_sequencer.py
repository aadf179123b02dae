"""A sequence of tasks: a LeafSystem around `task_sequence.advance`."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import BasicVector, Context, EventStatus, State

from pepper_drake.models.hands import hand_joint
from pepper_drake.naoqi.constants import HANDS
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.reach_mode import ReachMode
from pepper_drake.planning.reach.task_sequence import (
    SequenceState,
    SequenceTask,
    advance,
    hand_opening,
)
from pepper_drake.systems.framework import LeafSystem


class TaskSequencer(LeafSystem):
    """Gives the supervisor the next task once it has finished a movement.

    .. pydrake_system::

        name: TaskSequencer
        input_ports:
        - mode
        - object_pose
        - torso_pose
        - hand_pose
        output_ports:
        - command
        - primitive
        - task
        - hand_command

    Inputs: `mode` (1), the supervisor's `ReachMode`; `object_pose` X_WO, `torso_pose` X_WT,
    `hand_pose` X_TH.
    Outputs: `command` (1), a `ReachCommand`; `primitive`, abstract Movement, with the goal of the
    present task; `task` (1), its number, 0 for the reach; `hand_command` (2), openings from 0,
    closed, to 1, open, in the order of `HANDS`, NaN to leave a hand unchanged.
    State: `SequenceState` (abstract), every `time_step`.

    Args:
        reach: The reach that is performed first.
        tasks: The tasks that follow.
        arm: Arm whose hand opens and closes, "right" or "left".
        time_step: The supervisor's [s].
    """

    def __init__(
        self,
        reach: Movement,
        tasks: Sequence[SequenceTask],
        time_step: float,
        arm: str = "right",
    ) -> None:
        super().__init__()
        self._reach, self.tasks = reach, tuple(tasks)
        self._hand = HANDS.index(hand_joint(arm))
        self._mode = self.DeclareVectorInputPort("mode", 1)
        self._poses = {
            name: self.DeclareAbstractInputPort(name, Value(RigidTransform()))
            for name in ("object_pose", "torso_pose", "hand_pose")
        }
        self._state = self.DeclareAbstractState(Value[object](SequenceState(goals=(reach.X_OG,))))
        state = {self.abstract_state_ticket(self._state)}
        self.DeclareVectorOutputPort("command", 1, self._calc_command, prerequisites_of_calc=state)
        self.DeclareAbstractOutputPort(
            "primitive",
            lambda: Value[object](reach),
            self._calc_movement,
            prerequisites_of_calc=state,
        )
        self.DeclareVectorOutputPort("task", 1, self._calc_task, prerequisites_of_calc=state)
        self.DeclareVectorOutputPort(
            "hand_command", len(HANDS), self._calc_hand, prerequisites_of_calc=state
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(time_step, 0.0, self._update)

    def progress(self, context: Context) -> SequenceState:
        """Returns the present state in a context."""
        return context.get_abstract_state(int(self._state)).get_value()

    def _calc_command(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([float(self.progress(context).command)])

    def _calc_task(self, context: Context, output: BasicVector) -> None:
        output.SetFromVector([float(self.progress(context).task)])

    def _calc_hand(self, context: Context, output: BasicVector) -> None:
        command = np.full(len(HANDS), np.nan)
        command[self._hand] = hand_opening(self.progress(context), self.tasks)
        output.SetFromVector(command)

    def _calc_movement(self, context: Context, output: Value) -> None:
        state = self.progress(context)
        primitive = self._reach.primitive
        for task in self.tasks[: state.task]:
            primitive = task.primitive or primitive
        output.set_value(replace(self._reach, primitive=primitive, X_OG=state.goals[-1]))

    def _update(self, context: Context, state: State) -> EventStatus:
        before = self.progress(context)
        X_WO, X_WT, X_TH = (
            RigidTransform(self._poses[name].Eval(context))
            for name in ("object_pose", "torso_pose", "hand_pose")
        )
        now = before if before.X_TH_start is not None else replace(before, X_TH_start=X_TH)
        after = advance(
            now,
            self.tasks,
            self._reach.X_OG,
            context.get_time(),
            ReachMode(int(self._mode.Eval(context)[0])),
            X_WO.InvertAndCompose(X_WT),
        )
        if after is before:
            return EventStatus.DidNothing()
        state.get_mutable_abstract_state(int(self._state)).set_value(after)
        return EventStatus.Succeeded()
