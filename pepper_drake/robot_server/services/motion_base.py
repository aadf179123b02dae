"""ALMotion's moves of the base."""

import asyncio
import math
from collections.abc import Callable
from typing import Any

from pepper_drake.naoqi.constants import BASE_LIMITS, FRAME_ROBOT, FRAME_WORLD, WHEELS
from pepper_drake.robot_server.robot.base_controller import (
    BaseController,
    BaseSpeeds,
    FollowMove,
    Odometry,
    Pose,
    PoseMove,
    VelocityMove,
)
from pepper_drake.robot_server.robot.robot_port import RobotState
from pepper_drake.robot_server.robot.tasks import Task, TaskManager
from pepper_drake.robot_server.services.motion_arguments import number, numbers, settings
from pepper_drake.robot_server.services.movers import Movers
from pepper_drake.robot_server.services.waiting import until_ended
from pepper_drake.robot_server.wire.service import Caller
from pepper_drake.robot_server.wire.signatures import with_caller

_WHEELS = frozenset(WHEELS)
WHEEL_PLACES = ((0.09, 0.155, 1.07517), (0.09, -0.155, -1.07517), (-0.17, 0.0, -math.pi))
"""Place [m] and direction of the axle [rad] of `WHEELS` in the base."""


class BaseMoves:
    """Moves of the base: the newest one wins.

    Attributes:
        base: Its velocity.
        tasks: All tasks, moves included.
        state: The robot's newest state.
        when_stopped: Called when the base is told to stop, moving or not.
    """

    def __init__(self, state: RobotState, movers: Movers) -> None:
        self.base = BaseController()
        self.tasks = TaskManager()
        self.state = state
        self.when_stopped: list[Callable[[], None]] = []
        self.odometry = Odometry(state)
        self._movers = movers

    @with_caller
    def move(self, caller: Caller, x: float, y: float, theta: float, config: Any = ()) -> None:
        """Moves at a velocity [m/s, rad/s] until `stopMove`."""
        speeds = BaseSpeeds.configured(settings(config))
        self.start_move(VelocityMove(self.base, _pose(x, y, theta), speeds), "move", caller)

    @with_caller
    def move_toward(
        self, caller: Caller, x: float, y: float, theta: float, config: Any = ()
    ) -> None:
        """Moves at shares, from -1 to 1, of the largest velocities until `stopMove`."""
        speeds = BaseSpeeds.configured(settings(config))
        x, y, theta = (min(max(v, -1.0), 1.0) for v in _pose(x, y, theta))
        velocity = (x * speeds.speed, y * speeds.speed, theta * speeds.turning)
        self.start_move(VelocityMove(self.base, velocity, speeds), "moveToward", caller)

    @with_caller
    def set_walk_target_velocity(
        self, caller: Caller, x: float, y: float, theta: float, _frequency: float, *_config: Any
    ) -> None:
        """As `moveToward`, its name on NAO; frequency and gait are for legs."""
        self.move_toward(caller, x, y, theta)

    @with_caller
    async def move_to(self, caller: Caller, *arguments: Any) -> bool:
        """Moves to a pose relative to the base [m, rad]; returns whether it arrived.

        The arguments are x, y, theta, or a list of them, or a list of such lists: poses to pass. A
        time [s], a configuration or both may follow.
        """
        if len(arguments) < 3:
            points, rest = _points(arguments[0]), arguments[1:]
        else:
            points, rest = [_pose(*arguments[:3])], arguments[3:]
        duration = 0.0
        config: Any = ()
        for argument in rest:
            if isinstance(argument, list | tuple):
                config = argument
            else:
                duration = number(argument, "time")
        speeds = BaseSpeeds.configured(settings(config))
        motion = PoseMove(self.base, points, speeds, self.odometry, duration)
        await until_ended(self.tasks, self.start_move(motion, "moveTo", caller))
        return motion.succeeded

    @with_caller
    async def walk_to(self, caller: Caller, *arguments: Any) -> bool:
        """As `moveTo`, its name on NAO."""
        return await self.move_to(caller, *arguments)

    def move_init(self) -> None:
        """Prepares for moving; has no effect on wheels."""

    def walk_init(self) -> None:
        """As `moveInit`, its name on NAO."""

    async def wait_until_move_is_finished(self) -> None:
        """Returns when the base is at rest and no move is active."""
        while moves := self._moves():
            futures = [asyncio.ensure_future(_ended(task)) for task in moves]
            await asyncio.wait(futures)

    async def wait_until_walk_is_finished(self) -> None:
        """As `waitUntilMoveIsFinished`, its name on NAO."""
        await self.wait_until_move_is_finished()

    def move_is_active(self) -> bool:
        """Returns whether a move is active."""
        return bool(self._moves()) or not self.base.resting

    def walk_is_active(self) -> bool:
        """As `moveIsActive`, its name on NAO."""
        return self.move_is_active()

    def stop_move(self) -> None:
        """Brakes and ends active moves."""
        self.tasks.kill_where(lambda task: bool(task.resources & _WHEELS))
        self.base.stop()
        for end in self.when_stopped:
            end()

    def stop_walk(self) -> None:
        """As `stopMove`, its name on NAO."""
        self.stop_move()

    def kill_move(self) -> None:
        """As `stopMove`: on wheels there is no less safe stop."""
        self.stop_move()

    def kill_walk(self) -> None:
        """As `killMove`, its name on NAO."""
        self.stop_move()

    def get_move_config(self, which: str) -> list[list[Any]]:
        """Returns the limits of moves, "Max", "Min" or "Default", as [[key, value], ...]."""
        attribute = {"Max": "upper", "Min": "lower", "Default": "default"}.get(which)
        if attribute is None:
            raise ValueError(f"{which!r} is not a configuration; it must be Max, Min or Default")
        return [[key, getattr(limit, attribute)] for key, limit in BASE_LIMITS.items()]

    def get_robot_position(self, _use_sensors: bool) -> list[float]:
        """Returns the base's pose in the world by odometry: x, y [m], theta in [-pi, pi] [rad]."""
        return _with_wrapped_angle(self.state.base_pose)

    def get_next_robot_position(self) -> list[float]:
        """Returns the base's pose at the end of the current move."""
        goals = [
            task.motion.goal
            for task in self._moves()
            if isinstance(task.motion, PoseMove) and task.motion.goal is not None
        ]
        return _with_wrapped_angle(goals[-1] if goals else self.state.base_pose)

    def get_support_polygon(self, frame: int, _use_sensors: bool) -> list[list[float]]:
        """Returns where the wheels stand, x, y [m] in the world (1) or in the base's frame (2)."""
        if frame not in (FRAME_WORLD, FRAME_ROBOT):
            raise ValueError(f"frame is {frame}; it must be 1 (world) or 2 (robot)")
        x, y, theta = self.state.base_pose if frame == FRAME_WORLD else (0.0, 0.0, 0.0)
        c, s = math.cos(theta), math.sin(theta)
        return [[x + c * px - s * py, y + s * px + c * py] for px, py, _ in WHEEL_PLACES]

    def get_robot_velocity(self) -> list[float]:
        """Returns the base's velocity in its own frame: vx, vy [m/s], wz [rad/s]."""
        return list(self.state.base_velocity)

    def start_move(
        self, motion: VelocityMove | PoseMove | FollowMove, name: str, caller: Caller
    ) -> Task:
        """Starts a move of a client in place of the one before it."""
        self._movers.claim(caller, ("the base",))
        self.tasks.kill_where(lambda task: bool(task.resources & _WHEELS))
        return self.tasks.add(name, WHEELS, motion, caller.client)

    def _moves(self) -> list[Task]:
        return [task for task in self.tasks.tasks() if task.resources & _WHEELS]


async def _ended(task: Task) -> None:
    future: asyncio.Future[None] = asyncio.get_running_loop().create_future()
    task.when_ended(lambda: None if future.done() else future.set_result(None))
    await future


def _with_wrapped_angle(pose: Pose) -> list[float]:
    """Returns a pose as robots tell it: programs that wait for a full turn count on the step."""
    x, y, theta = pose
    return [x, y, math.remainder(theta, 2 * math.pi)]


def _pose(x: Any, y: Any, theta: Any) -> Pose:
    return number(x, "x"), number(y, "y"), number(theta, "theta")


def _points(value: Any) -> list[Pose]:
    if isinstance(value, list | tuple) and value and isinstance(value[0], list | tuple):
        return [_pose(*numbers(point, 3, "a control point")) for point in value]
    return [_pose(*numbers(value, 3, "a control point"))]
