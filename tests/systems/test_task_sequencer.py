from dataclasses import replace

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from pepper_drake.diagrams.factory import make_primitive
from pepper_drake.planning.reach.movement import Movement
from pepper_drake.planning.reach.reach_mode import ReachCommand, ReachMode
from pepper_drake.planning.reach.reach_state import ReachState, apply_command
from pepper_drake.planning.reach.task_sequence import SequenceTask, hand_time
from pepper_drake.systems.framework import LeafSystem
from pepper_drake.systems.task_sequencer import TaskSequencer

STEP = 0.05
X_WO = RigidTransform(RollPitchYaw(0.0, 0.0, 0.4), [0.9, 0.1, 0.8])
X_WT = RigidTransform([0.3, 0.0, 0.82])
X_TH = RigidTransform(RollPitchYaw(0.1, 0.2, 0.3), [0.1, -0.2, -0.1])
X_OG = RigidTransform([-0.1, 0.0, 0.02])
REACH, LIFT = make_primitive(None, "right"), make_primitive(None, "left")


class Performer(LeafSystem):
    """Obeys commands as the supervisor does; a movement takes a second, or fails."""

    def __init__(self, fails_at=99):
        super().__init__()
        self._fails_at, self.performed = fails_at, []
        self._command = self.DeclareVectorInputPort("command", 1)
        self._movement = self.DeclareAbstractInputPort("primitive", Value[object](None))
        self._state = self.DeclareAbstractState(Value[object](ReachState()))
        self.DeclareVectorOutputPort(
            "mode",
            1,
            lambda context, out: out.SetFromVector([self._now(context).mode]),
            prerequisites_of_calc={self.abstract_state_ticket(self._state)},
        )
        self.DeclarePeriodicUnrestrictedUpdateEvent(STEP, 0.0, self._update)

    def _now(self, context):
        return context.get_abstract_state(int(self._state)).get_value()

    def _update(self, context, state):
        command = ReachCommand(int(self._command.Eval(context)[0]))
        now = apply_command(self._now(context), command, context.get_time())
        if now.mode in (ReachMode.LOOKING, ReachMode.SETTLING) and (
            context.get_time() - now.since > 1.0 - 1e-9
        ):
            self.performed.append((now.mode, now.may_drive, self._movement.Eval(context)))
            failed = len(self.performed) > self._fails_at
            now = now.to(ReachMode.FAILED if failed else ReachMode.DONE, context.get_time())
        state.get_mutable_abstract_state(int(self._state)).set_value(now)


def perform(tasks, seconds, **options):
    builder = DiagramBuilder()
    sequencer = builder.AddSystem(TaskSequencer(Movement(REACH, None, X_OG), tasks, STEP))
    performer = builder.AddSystem(Performer(**options))
    builder.Connect(performer.GetOutputPort("mode"), sequencer.GetInputPort("mode"))
    for name in ("command", "primitive"):
        builder.Connect(sequencer.GetOutputPort(name), performer.GetInputPort(name))
    for name in ("object_pose", "torso_pose", "hand_pose"):
        builder.ExportInput(sequencer.GetInputPort(name), name)
    diagram = builder.Build()
    simulator = Simulator(diagram)
    for name, value in (("object_pose", X_WO), ("torso_pose", X_WT), ("hand_pose", X_TH)):
        diagram.GetInputPort(name).FixValue(simulator.get_mutable_context(), value)
    simulator.AdvanceTo(seconds)
    state = sequencer.progress(sequencer.GetMyContextFromRoot(simulator.get_context()))
    return state, performer.performed


TASKS = (
    SequenceTask("wait", wait=0.5),
    SequenceTask("lift", LIFT, offset=(0.0, 0.0, 0.06)),
    SequenceTask("put down", REACH),
    SequenceTask("return", REACH, returns=True),
)


def test_tasks_are_performed_in_order_each_with_its_goal_and_movement():
    state, performed = perform(TASKS, 8.0)
    assert state.finished
    modes = [mode for mode, _, _ in performed]
    assert modes == [ReachMode.LOOKING, *[ReachMode.SETTLING] * 3]
    # The base is driven for the reach alone.
    assert [may_drive for _, may_drive, _ in performed] == [True, False, False, False]
    movements = [movement for _, _, movement in performed]
    assert [m.primitive for m in movements] == [REACH, LIFT, REACH, REACH]
    places = [m.X_OG.translation() for m in movements[:3]]
    np.testing.assert_allclose(places, [[-0.1, 0, 0.02], [-0.1, 0, 0.08], [-0.1, 0, 0.02]])
    home = X_WO @ movements[3].X_OG
    np.testing.assert_allclose(home.GetAsMatrix4(), (X_WT @ X_TH).GetAsMatrix4(), atol=1e-12)


GRIP = (
    SequenceTask("open", hand=1.0),
    SequenceTask("close", hand=0.0),
    SequenceTask("lift", LIFT, offset=(0.0, 0.0, 0.06)),
    SequenceTask("relax", hand=0.5),
)


@pytest.mark.parametrize("arm", ["left", "right"])
def test_a_hand_is_half_open_at_first_and_stays_as_it_was_told(arm):
    sequencer = TaskSequencer(Movement(REACH, None, X_OG), GRIP, STEP, arm)
    context = sequencer.CreateDefaultContext()
    wanted = []
    for task in range(len(GRIP) + 1):
        state = replace(sequencer.progress(context), task=task)
        context.SetAbstractState(0, state)
        wanted.append(sequencer.GetOutputPort("hand_command").Eval(context))
    working = 0 if arm == "left" else 1
    assert [command[working] for command in wanted] == [0.5, 1.0, 0.0, 0.0, 0.5]
    assert np.isnan([command[1 - working] for command in wanted]).all()
    assert [hand_time(task, GRIP) for task in GRIP] == pytest.approx([1 / 3, 2 / 3, 0.0, 1 / 3])


def test_the_arm_stays_while_its_hand_closes():
    assert perform(GRIP[:1], 1.4)[0].task == 1
    assert not perform(GRIP[:1], 1.4)[0].finished
    assert perform(GRIP[:1], 1.7)[0].finished


def test_a_wait_takes_its_time_at_the_goal():
    state, performed = perform(TASKS[:1], 1.4)
    assert (state.task, state.finished, len(performed)) == (1, False, 1)
    assert perform(TASKS[:1], 1.8)[0].finished


@pytest.mark.parametrize("number", [0, 2])
def test_nothing_follows_a_task_that_failed(number):
    state, performed = perform(TASKS, 8.0, fails_at=number)
    assert not state.finished
    assert len(performed) == number + 1


def test_a_movement_is_planned_from_where_the_base_stands():
    idle = apply_command(ReachState(), ReachCommand.IDLE, 1.0)
    state = apply_command(idle, ReachCommand.MOVE, 2.0)
    assert (state.mode, state.since, state.may_drive) == (ReachMode.SETTLING, 2.0, False)
    assert apply_command(state, ReachCommand.MOVE, 3.0) is state
