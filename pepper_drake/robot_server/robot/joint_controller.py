"""ALMotion's control of the joints: targets, timed paths, stiffness, limits, at 50 Hz."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import numpy.typing as npt

from pepper_drake.naoqi.constants import CYCLE, JOINTS
from pepper_drake.robot_server.robot.robot_model import MAX_VELOCITY, clip_to_limits
from pepper_drake.robot_server.robot.robot_port import RobotState
from pepper_drake.robot_server.robot.tasks import TaskManager, TaskState
from pepper_drake.robot_server.robot.time_laws import ACCELERATION, step_towards, stopping_point

Vector = npt.NDArray[np.float64]
Sampler = Callable[[float, float], Vector]
"""From the current value and rate to the values of the next cycles."""

INDEX: dict[str, int] = {name: k for k, name in enumerate(JOINTS)}
"""Index of a joint among the 17."""

ARRIVED = 1e-9
"""Distance below which a command has arrived [rad]."""

STIFFNESS = "/Stiffness"
"""Suffix of a joint's name for the resource of its stiffness."""


class JointController:
    """Commands of the 17 joints.

    Each cycle a joint's command moves towards its target, unless a task drives it along a path.
    The command keeps the position limits, the yaw-coupled ones included, and the largest speed.
    A limp joint's command and target are its measured position.

    Attributes:
        command: Commanded positions (17,) [rad; hands 0..1].
        velocity: Rate of the command (17,) [rad/s].
        stiffness: Stiffnesses (17,), from 0 to 1.
    """

    def __init__(self, state: RobotState) -> None:
        self.command: Vector = state.positions.copy()
        self.velocity: Vector = np.zeros(len(JOINTS))
        self.stiffness: Vector = np.zeros(len(JOINTS))
        self._target = self.command.copy()
        self._speed = np.zeros(len(JOINTS))
        self._driven: dict[int, float] = {}
        self._behind: set[int] = set()

    def set_targets(self, targets: Mapping[str, float], fraction: float) -> None:
        """Sets targets of joints [rad] at a fraction of their largest speed, from now on.

        A joint that is limp gets no target.
        """
        indices = [INDEX[name] for name in targets if self.stiffness[INDEX[name]] > 0.0]
        wanted = self._target.copy()
        for name, value in targets.items():
            wanted[INDEX[name]] = value
        self._target[indices] = clip_to_limits(wanted)[indices]
        self._speed[indices] = fraction * MAX_VELOCITY[indices]

    def drive(self, name: str, value: float) -> None:
        """Sets a joint's command in this cycle to a value of a task's path [rad]."""
        self._driven[INDEX[name]] = value

    def halt(self, names: Sequence[str]) -> None:
        """Brakes joints to rest."""
        rest = stopping_point(self.command, self.velocity, ACCELERATION)
        for k in (INDEX[name] for name in names):
            self._target[k] = rest[k]
            self._speed[k] = abs(self.velocity[k])

    def set_stiffness(self, name: str, value: float) -> None:
        """Sets one joint's stiffness, from 0 to 1."""
        self.stiffness[INDEX[name]] = min(max(value, 0.0), 1.0)

    def arrived(self, name: str, value: float) -> bool:
        """Returns whether a joint is limp or its command is at a value, clipped to its limits."""
        k = INDEX[name]
        wanted = self.command.copy()
        wanted[k] = value
        return bool(
            self.stiffness[k] == 0.0 or abs(self.command[k] - clip_to_limits(wanted)[k]) < ARRIVED
        )

    def step(self, state: RobotState) -> None:
        """Computes the commands of the next cycle, after the tasks have driven their joints."""
        position, _ = step_towards(
            self.command, self.velocity, self._target, self._speed, ACCELERATION
        )
        reach = MAX_VELOCITY * CYCLE
        self._behind &= self._driven.keys()
        for k, value in self._driven.items():
            if k in self._behind or abs(value - self.command[k]) > reach[k]:
                position[k] = self._chase(k, value)
            else:
                position[k] = value
        position = clip_to_limits(position)
        position = np.clip(position, self.command - reach, self.command + reach)
        limp = self.stiffness == 0.0
        position = np.where(limp, state.positions, position)
        self.velocity = np.where(limp, 0.0, (position - self.command) / CYCLE)
        self.command = position
        driven = list(self._driven)
        self._target[driven] = position[driven]
        self._target = np.where(limp, position, self._target)
        self._driven.clear()

    def _chase(self, k: int, value: float) -> float:
        """Returns the next command of a joint that lags behind its path, at its largest speed."""
        at = slice(k, k + 1)
        position, _ = step_towards(
            self.command[at],
            self.velocity[at],
            np.array([value]),
            MAX_VELOCITY[at],
            ACCELERATION[at],
        )
        if abs(position[0] - value) < ARRIVED:
            self._behind.discard(k)
        else:
            self._behind.add(k)
        return float(position[0])


class PathMotion:
    """Joints that follow timed paths; a task's motion.

    The paths are made when the task starts, from the joints' commands at that time.
    """

    def __init__(self, controller: JointController, samplers: Mapping[str, Sampler]) -> None:
        self._controller = controller
        self._samplers = dict(samplers)
        self._paths: dict[str, Vector] = {}
        self._cycle = 0

    def start(self) -> None:
        """Computes the paths."""
        for name, sampler in self._samplers.items():
            k = INDEX[name]
            self._paths[name] = sampler(self._controller.command[k], self._controller.velocity[k])

    def step(self) -> bool:
        """Drives each joint to its next sample; ends when all have arrived.

        A joint slower than its path catches up later.
        """
        length = max(map(len, self._paths.values()), default=0)
        done = self._cycle >= length and all(
            self._controller.arrived(name, path[-1]) for name, path in self._paths.items()
        )
        if done:
            return True
        for name, path in self._paths.items():
            self._controller.drive(name, float(path[min(self._cycle, len(path) - 1)]))
        self._cycle += 1
        return False

    def stop(self) -> None:
        """Brakes the joints."""
        self._controller.halt(list(self._paths))

    def release(self, name: str) -> None:
        """Drops a joint's path in favour of a newer target."""
        self._paths.pop(name, None)


class StiffnessMotion:
    """Stiffnesses that follow timed ramps; a task's motion."""

    def __init__(self, controller: JointController, samplers: Mapping[str, Sampler]) -> None:
        self._controller = controller
        self._samplers = samplers
        self._paths: dict[str, Vector] = {}
        self._cycle = 0

    def start(self) -> None:
        """Computes the ramps."""
        for name, sampler in self._samplers.items():
            self._paths[name] = sampler(float(self._controller.stiffness[INDEX[name]]), 0.0)

    def step(self) -> bool:
        """Sets the next stiffnesses."""
        for name, path in self._paths.items():
            self._controller.set_stiffness(name, float(path[min(self._cycle, len(path) - 1)]))
        self._cycle += 1
        return self._cycle >= max(map(len, self._paths.values()))

    def stop(self) -> None:
        """Leaves the stiffnesses unchanged."""


def retarget(
    controller: JointController, tasks: TaskManager, targets: Mapping[str, float], fraction: float
) -> None:
    """Sets targets of joints at once; running paths drop these joints."""
    for task in tasks.tasks():
        if isinstance(task.motion, PathMotion) and task.state is TaskState.RUNNING:
            for name in targets:
                task.motion.release(name)
    controller.set_targets(targets, fraction)
