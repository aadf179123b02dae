"""ALNavigation: moves of the base, and the map of the floor that its lasers make."""

import math
import zipfile
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import PurePosixPath
from typing import Any

import numpy as np

from pepper_drake.robot_server.robot.floor_map import (
    CELL,
    FloorMap,
    LaserScan,
    Vector,
    composed,
    inverted,
)
from pepper_drake.robot_server.robot.range_sensors import PERIOD, laser_scan
from pepper_drake.robot_server.services.kept_settings import keep_settings
from pepper_drake.robot_server.services.motion_arguments import number, numbers
from pepper_drake.robot_server.services.recorders import RobotDisk
from pepper_drake.robot_server.services.waiting import Module, RobotTimer
from pepper_drake.robot_server.wire.service import Caller
from pepper_drake.robot_server.wire.signatures import with_caller

_FOLDER = "/home/nao/.local/share/Explorer"
_AROUND = (0.0, math.radians(50.0), math.radians(-100.0), math.radians(50.0))
"""Turns, after each of which the lasers look: together they see all around [rad]."""
_DONE, _FAILED = 0, 1
_MOST_WAYS = 8
"""Times that a way is looked for to a place, with what was seen on the way before."""


class Navigation(Module):
    """ALNavigation. `navigateTo` moves straight; in a map the base goes around what it saw."""

    def __init__(self, moves: Any, timer: RobotTimer, disk: RobotDisk) -> None:
        """Makes the service.

        Args:
            moves: ALMotion.
            timer: The robot's clock.
            disk: Where maps are kept.
        """
        super().__init__("ALNavigation")
        self._moves, self._timer, self._disk = moves, timer, disk
        self._map: FloorMap | None = None
        self._X_WM = np.zeros(3)  # The map in the odometry's world.
        self._path = ""
        self._is_exploring = self._is_localized = False
        self.move_to = moves.move_to
        self.move = moves.move
        self.move_toward = moves.move_toward
        keep_settings(self, {"set_security_distance": ("get_security_distance", 0.4)})

    @with_caller
    async def navigate_to(self, caller: Caller, x: float, y: float, *rest: Any) -> bool:
        """Moves straight to a place relative to the base [m, rad]; returns whether it got there."""
        theta = next((value for value in rest if isinstance(value, int | float)), 0.0)
        return bool(await self._moves.move_to(caller, x, y, theta))

    def stop_navigate_to(self) -> None:
        """Brakes."""
        self._moves.stop_move()

    @with_caller
    async def explore(self, caller: Caller, radius: float) -> int:
        """Maps the floor within a radius [m]; returns 0, or 1 if it was stopped or hindered."""
        if not 0.0 < number(radius, "radius") < 100.0:
            raise ValueError(f"the radius is {radius:g} m; it must be above 0 and below 100")
        self._scan()
        self._map, self._path = FloorMap(), ""
        self._X_WM = np.array(self._moves.state.base_pose)
        self._is_exploring = True
        try:
            while self._is_exploring:
                for turn in _AROUND:
                    if turn and not await self._moves.move_to(caller, 0.0, 0.0, turn):
                        return _FAILED
                    self._map.add(await self._look(), self._pose())
                way = self._map.frontier(self._pose(), radius)
                if way is None:
                    return _DONE
                if not await self._follow(caller, way, self._map):
                    return _FAILED
            return _FAILED
        finally:
            self._is_exploring = False

    def stop_exploration(self) -> None:
        """Stops an exploration; what it saw is kept."""
        if self._is_exploring:
            self._is_exploring = False
            self._moves.stop_move()

    def save_exploration(self) -> str:
        """Writes the map; returns its path."""
        known = self._known()
        now = datetime.fromtimestamp(self._timer.now, UTC)
        name = f"{now:%Y-%m-%dT%H%M%S}.{now.microsecond // 1000:03d}Z.explo"
        self._path, place = self._disk.place(_FOLDER, name)
        with place.open("wb") as file:
            np.savez_compressed(file, log_odds=known.log_odds, origin=known.origin)
        return self._path

    def load_exploration(self, path: str) -> int:
        """Reads a map, which the robot takes itself to be at the origin of; returns 0."""
        where = PurePosixPath(path)
        told, place = self._disk.place(str(PurePosixPath(_FOLDER) / where.parent), where.name)
        if not place.is_file():
            raise ValueError(f"there is not an exploration {told}")
        try:
            with np.load(place, allow_pickle=False) as file:
                log_odds, origin = (
                    np.array(file["log_odds"], float),
                    np.array(file["origin"], float),
                )
        except (OSError, ValueError, KeyError, zipfile.BadZipFile):
            raise ValueError(f"{told} is not an exploration") from None
        if log_odds.ndim != 2 or origin.shape != (2,) or not np.isfinite(log_odds).all():
            raise ValueError(f"{told} is not an exploration")
        self._map, self._path = FloorMap(log_odds, origin), told
        self._X_WM = np.array(self._moves.state.base_pose)
        self._is_localized = False
        return _DONE

    def get_exploration_path(self) -> str:
        """Returns the path of the map that was saved or loaded."""
        if not self._path:
            raise ValueError("no exploration was saved or loaded")
        return self._path

    def get_metrical_map(self) -> list[Any]:
        """Returns metres per pixel, width, height, x and y of the top left, and the pixels.

        A pixel is 0 where the floor is free, 100 where something stands, and 50 where nothing is
        known.
        """
        known = self._known()
        rows, columns = known.log_odds.shape
        x, y = known.origin
        top_left = [float(x), float(y + rows * CELL)]
        return [CELL, columns, rows, top_left, known.percent().ravel().tolist()]

    def start_localization(self) -> None:
        """Finds the robot in the map, near where it takes itself to be."""
        self._known()
        self._is_localized = True
        self._locate()

    def stop_localization(self) -> None:
        """Forgets where in the map the robot is."""
        self._is_localized = False

    def relocalize_in_map(self, guess: Sequence[float]) -> list[list[float]]:
        """Finds the robot in the map near a guess: x, y and maybe theta [m, rad]."""
        self._known()
        x, y, *rest = numbers(guess, len(guess) if len(guess) in (2, 3) else 3, "the pose")
        theta = rest[0] if rest else float(self._pose()[2])
        self._place(np.array([x, y, theta]))
        self._is_localized = True
        self._locate()
        return self.get_robot_position_in_map()

    def get_robot_position_in_map(self) -> list[list[float]]:
        """Returns x, y, theta in the map [m, rad], and how far off each may be."""
        if not self._is_localized:
            raise ValueError("the robot is not localized; startLocalization does it")
        return [self._pose().tolist(), [CELL, CELL, CELL]]

    @with_caller
    async def navigate_to_in_map(self, caller: Caller, goal: Sequence[float]) -> int:
        """Goes to x, y, theta in the map [m, rad]; returns 0, or 1 if it did not get there."""
        target = numbers(goal, 3, "the pose")
        if not self._is_localized:
            raise ValueError("the robot is not localized; startLocalization does it")
        known = self._known()
        for _ in range(_MOST_WAYS):
            scan = await self._look()
            self._locate()
            seen = FloorMap(known.log_odds.copy(), known.origin.copy())
            seen.add(scan, self._pose())
            way = seen.path(self._pose(), target)
            if way is None or not await self._follow(caller, way, seen):
                return _FAILED
            x, y, theta = self._pose()
            if math.hypot(target[0] - x, target[1] - y) < CELL:
                turn = math.remainder(target[2] - theta, 2 * math.pi)
                return _DONE if await self._moves.move_to(caller, 0.0, 0.0, turn) else _FAILED
        return _FAILED

    async def _follow(self, caller: Caller, way: list[Vector], seen: FloorMap) -> bool:
        """Drives along a way until it is at its end, or sees that it is blocked.

        Returns whether the robot did what it was told.
        """
        for point in way:
            x, y, theta = self._pose()
            ahead = math.atan2(point[1] - y, point[0] - x)
            turn = math.remainder(ahead - theta, 2 * math.pi)
            if not await self._moves.move_to(caller, 0.0, 0.0, turn):
                return False
            seen.add(await self._look(), self._pose())
            x, y, _ = self._pose()
            rest = seen.path((x, y), point)
            if rest is None or len(rest) > 1:
                return True  # Something stands there: another way is looked for.
            distance = math.hypot(point[0] - x, point[1] - y)
            if not await self._moves.move_to(caller, distance, 0.0, 0.0):
                return False
        return True

    async def _look(self) -> LaserScan:
        """Waits for a scan that was taken at rest."""
        await self._timer.sleep(2 * PERIOD)
        return self._scan()

    def _scan(self) -> LaserScan:
        scan = laser_scan(self._moves.state.ranges)
        if scan is None:
            raise ValueError("this robot's lasers measure nothing")
        return scan

    def _known(self) -> FloorMap:
        if self._map is None:
            raise ValueError("there is no map; explore makes one, loadExploration reads one")
        return self._map

    def _pose(self) -> Vector:
        """The base in the map."""
        return composed(inverted(self._X_WM), self._moves.state.base_pose)

    def _place(self, pose: Vector) -> None:
        """Takes the base to be at a pose in the map."""
        self._X_WM = composed(self._moves.state.base_pose, inverted(pose))

    def _locate(self) -> None:
        """Corrects the pose in the map by what the lasers see."""
        scan = laser_scan(self._moves.state.ranges)
        if scan is not None:
            self._place(self._known().matched(scan, self._pose()))
