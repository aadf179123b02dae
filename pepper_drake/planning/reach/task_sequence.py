"""Sequence of arm tasks after the reach, from the same base pose.

If any task opens or closes the hand, the hand is half open until then, as while the arm moves.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from pydrake.math import RigidTransform

from pepper_drake.learning import MovementPrimitive
from pepper_drake.models.hands import HAND_SPEED, RELAXED
from pepper_drake.planning.reach.reach_mode import ReachCommand, ReachMode


@dataclass(frozen=True, eq=False)
class SequenceTask:
    """One task after the reach.

    Attributes:
        name: Name for reports.
        primitive: Primitive with orientation and posture; None to hold the hand's pose.
        wait: Holding time [s].
        offset: (3,) the hand's goal relative to its pre-grasp pose, in the goal object's frame [m].
        hand: Opening of the hand, from 0, closed, to 1, open; None for no change.
        returns: Whether the goal is the hand's pose in the torso frame before the reach.
    """

    name: str
    primitive: MovementPrimitive | None = None
    wait: float = 0.0
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    hand: float | None = None
    returns: bool = False


@dataclass(frozen=True, eq=False)
class SequenceState:
    """Progress in a sequence of the reach (task 0) and the tasks after it.

    Attributes:
        task: Number of the task.
        since: When it began [s].
        command: Command to the supervisor.
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
        """Returns itself: Drake copies the state at each event, and it is immutable."""
        return self


def hand_opening(state: SequenceState, tasks: Sequence[SequenceTask]) -> float:
    """Returns the desired opening of the hand; NaN for no change.

    Args:
        state: Progress in the sequence.
        tasks: Tasks after the reach.
    """
    opening = math.nan if all(task.hand is None for task in tasks) else RELAXED
    for task in tasks[: state.task]:
        opening = opening if task.hand is None else task.hand
    return opening


def hand_time(task: SequenceTask, tasks: Sequence[SequenceTask]) -> float:
    """Returns the time [s] that the hand needs for the opening of a task.

    It covers the full travel from the previous opening of the sequence, or from the relaxed hand: a
    hand that closes on an object stops earlier, but this is not measured.
    """
    if task.hand is None:
        return 0.0
    before = [other.hand for other in tasks[: tasks.index(task)] if other.hand is not None]
    start = before[-1] if before else RELAXED
    return abs(task.hand - start) / HAND_SPEED


def advance(
    state: SequenceState,
    tasks: Sequence[SequenceTask],
    pre_grasp: RigidTransform,
    time: float,
    mode: ReachMode,
    X_OT: RigidTransform,
) -> SequenceState:
    """Returns the state after an observation.

    During a wait the hand keeps following the last goal. Between two movements the supervisor is
    idle for one step, so that it takes the next as a new one.

    Args:
        state: State before.
        tasks: Tasks after the reach.
        pre_grasp: X_OG of the reach.
        time: Present time [s].
        mode: Mode of the supervisor.
        X_OT: Pose of the torso in the goal object's frame.
    """
    if state.finished or mode == ReachMode.FAILED:
        return state
    if state.command == ReachCommand.IDLE:
        return replace(state, command=ReachCommand.MOVE) if mode == ReachMode.IDLE else state
    if mode != ReachMode.DONE:
        return state
    current = tasks[state.task - 1] if state.task else None
    if current is not None and current.primitive is None:
        stay = max(current.wait, hand_time(current, tasks))
        if time - state.since < stay:
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
