"""Tasks in sequence: after the reach, what the arm does next, from where the base stands."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pydrake.math import RigidTransform

from pepper_drake.learning import MovementPrimitive
from pepper_drake.planning.reach.reach_mode import ReachCommand, ReachMode


@dataclass(frozen=True, eq=False)
class SequenceTask:
    """One task after the reach.

    Attributes:
        name: For reports.
        primitive: What is performed, with orientation and posture; None waits where the hand is.
        wait: How long it waits [s].
        offset: (3,) where the hand goes, from its pre-grasp pose, in the goal object's frame [m].
        returns: It goes to where the hand was in the torso frame before the reach.
    """

    name: str
    primitive: MovementPrimitive | None = None
    wait: float = 0.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    returns: bool = False


@dataclass(frozen=True, eq=False)
class SequenceState:
    """Progress in a sequence of the reach (task 0) and the tasks after it.

    Attributes:
        task: Number of the task.
        since: When it began [s].
        command: What the supervisor is told.
        X_TH_start: The hand's pose in T before the reach; None before it was measured.
        goals: For each task begun so far, the hand's goal in the goal object's frame X_OG.
        finished: Whether the last task is over.
    """

    task: int = 0
    since: float = 0.0
    command: ReachCommand = ReachCommand.REACH
    X_TH_start: RigidTransform | None = None
    goals: tuple[RigidTransform, ...] = ()
    finished: bool = False

    def __deepcopy__(self, memo: dict) -> "SequenceState":
        """Returns itself: Drake copies the state at each event, and this never changes."""
        return self


def advance(
    state: SequenceState,
    tasks: Sequence[SequenceTask],
    pre_grasp: RigidTransform,
    time: float,
    mode: ReachMode,
    X_OT: RigidTransform,
) -> SequenceState:
    """Returns the state after an observation.

    A wait is spent at the last goal, which the hand goes on to follow. Between two movements the
    supervisor is idle for one step, so that it takes the next one for another.

    Args:
        state: Before.
        tasks: Those after the reach.
        pre_grasp: X_OG of the reach.
        time: Now [s].
        mode: The supervisor's.
        X_OT: The torso's pose in the goal object's frame.
    """
    if state.finished or mode == ReachMode.FAILED:
        return state
    if state.command == ReachCommand.IDLE:
        return replace(state, command=ReachCommand.MOVE) if mode == ReachMode.IDLE else state
    if mode != ReachMode.DONE:
        return state
    current = tasks[state.task - 1] if state.task else None
    if current is not None and current.primitive is None and time - state.since < current.wait:
        return state
    if state.task == len(tasks):
        return replace(state, finished=True)
    upcoming = tasks[state.task]
    goal = state.goals[-1]
    if upcoming.primitive is not None:
        goal = RigidTransform(pre_grasp.rotation(), pre_grasp.translation() + upcoming.offset)
    if upcoming.returns and state.X_TH_start is not None:
        goal = X_OT @ state.X_TH_start
    moves = upcoming.primitive is not None
    return replace(
        state,
        task=state.task + 1,
        since=time,
        command=ReachCommand.IDLE if moves else state.command,
        goals=(*state.goals, goal),
    )
