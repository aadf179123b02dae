"""ALMotion's tasks: which motion may move which joint.

A task books resources, joints by name, while it runs. If they are taken it waits until they are
free, first come first served; it is not refused, and does not interrupt the earlier task.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol


class TaskState(Enum):
    """State of a task."""

    POSTPONED = "postponed"
    RUNNING = "running"
    DONE = "done"
    KILLED = "killed"


class Motion(Protocol):
    """The motion of a task, cycle by cycle."""

    def start(self) -> None:
        """Begins, in the cycle in which its resources become free."""

    def step(self) -> bool:
        """Runs one cycle; returns whether it was the last."""

    def stop(self) -> None:
        """Brakes smoothly: the task was killed."""


@dataclass
class Task:
    """A motion with a number.

    Attributes:
        id: Its number, from 1.
        name: Method that requested it, such as "angleInterpolation".
        resources: What it books.
        motion: Its motion.
        client: Connection of the client that requested it, or None if it outlives clients.
        state: Its state.
    """

    id: int
    name: str
    resources: frozenset[str]
    motion: Motion
    client: int | None = None
    state: TaskState = TaskState.POSTPONED
    _watchers: list[Callable[[], None]] = field(default_factory=list, repr=False)

    @property
    def ended(self) -> bool:
        """Returns whether it is done or killed."""
        return self.state in (TaskState.DONE, TaskState.KILLED)

    def when_ended(self, watcher: Callable[[], None]) -> None:
        """Calls `watcher` when the task has ended, or now if it has."""
        if self.ended:
            watcher()
        else:
            self._watchers.append(watcher)

    def end(self, state: TaskState) -> None:
        """Sets the final state and notifies the watchers."""
        self.state = state
        watchers, self._watchers = self._watchers, []
        for watcher in watchers:
            watcher()


class TaskManager:
    """The list of tasks, oldest first."""

    def __init__(self) -> None:
        self._tasks: list[Task] = []
        self._last = 0

    def add(
        self, name: str, resources: Iterable[str], motion: Motion, client: int | None = None
    ) -> Task:
        """Adds a task; it starts at once if its resources are free."""
        self._last += 1
        task = Task(self._last, name, frozenset(resources), motion, client)
        self._tasks.append(task)
        self._start_free()
        return task

    def step(self) -> None:
        """Runs one cycle of every running task, then starts tasks whose resources became free."""
        for task in [task for task in self._tasks if task.state is TaskState.RUNNING]:
            # A task may end another one, as a move ends the move before it.
            if task.state is TaskState.RUNNING and task.motion.step():
                self._tasks.remove(task)
                task.end(TaskState.DONE)
        self._start_free()

    def kill(self, task_id: int) -> bool:
        """Ends a task, running or postponed; returns whether there was one of that number."""
        task = next((task for task in self._tasks if task.id == task_id), None)
        if task is None:
            return False
        self._tasks.remove(task)
        if task.state is TaskState.RUNNING:
            task.motion.stop()
        task.end(TaskState.KILLED)
        self._start_free()
        return True

    def kill_where(self, condition: Callable[[Task], bool]) -> None:
        """Ends every task for which a condition holds, the youngest first."""
        for task in reversed([task for task in self._tasks if condition(task)]):
            self.kill(task.id)

    def booked(self) -> frozenset[str]:
        """Returns the resources of the running tasks."""
        running = (task.resources for task in self._tasks if task.state is TaskState.RUNNING)
        return frozenset().union(*running)

    def tasks(self) -> list[Task]:
        """Returns the tasks that have not ended, oldest first."""
        return list(self._tasks)

    def _start_free(self) -> None:
        taken: set[str] = set()
        for task in self._tasks:
            if task.state is TaskState.POSTPONED and not taken & task.resources:
                task.state = TaskState.RUNNING
                task.motion.start()
            taken |= task.resources
