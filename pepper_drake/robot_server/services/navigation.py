"""ALNavigation: moves of the base, and mapping of the floor with its lasers."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Coroutine, Sequence
from datetime import UTC, datetime
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from scipy import spatial

from pepper_drake.errors import InputError
from pepper_drake.naoqi.wire import Typed
from pepper_drake.robot_server.robot.floor_map import (
    CELL,
    EXTENT,
    FloorMap,
    LaserScan,
    Mask,
    Vector,
    composed,
    inverted,
    read_floor_map,
    transformed,
    write_floor_map,
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
"""Turns before each scan: together the scans cover all directions [rad]."""
_DONE, _FAILED = 0, 1
_MOST_PLANS = 8
"""Largest number of replannings to a goal, each with the scans so far."""
_WORST_MATCH = 2 * CELL
"""Largest mean distance of a scan's hits from the map for a localization [m]."""
_EXPLORING, _IN_MAP, _STRAIGHT = "explore", "navigateToInMap", "navigateTo"
_ALONG = "moveAlong"
_DRIVES = (_EXPLORING, _IN_MAP, _STRAIGHT, _ALONG)
_CIRCLE_POINTS = 16
"""Waypoints on a circle."""
_NOT_LOCALIZED = "the robot is not localized; startLocalization does it"

Look = Callable[[], Awaitable[FloorMap]]
"""Takes a scan, and returns the updated map."""


class Navigation(Module):
    """ALNavigation. `navigateTo` moves straight; in a map the base avoids mapped obstacles.

    Work that takes time is one task: while it runs no other may start, and anything that stops the
    base ends it. Work on a whole map runs on another thread, so that other calls need not wait.
    """

    def __init__(self, moves: Any, timer: RobotTimer, disk: RobotDisk) -> None:
        """Makes the service.

        Args:
            moves: ALMotion.
            timer: The robot's clock.
            disk: For the maps.
        """
        super().__init__("ALNavigation")
        self._moves, self._timer, self._disk = moves, timer, disk
        self._map: FloorMap | None = None
        self._X_WM = np.zeros(3)  # Pose of the map in the odometry's world.
        self._path = ""
        self._is_localized = False
        self._is_gathering = False
        self._work: asyncio.Task[int] | None = None
        self.move_to = moves.move_to
        self.move = moves.move
        self.move_toward = moves.move_toward
        moves.when_stopped.append(self._stop)
        keep_settings(self, {"set_security_distance": ("get_security_distance", 0.4)})

    @with_caller
    async def navigate_to(self, caller: Caller, x: float, y: float, *rest: Any) -> bool:
        """Moves straight to a pose relative to the base [m, rad]; returns whether it arrived."""
        theta = next((value for value in rest if isinstance(value, int | float)), 0.0)

        async def drive() -> int:
            return _DONE if await self._moves.move_to(caller, x, y, theta) else _FAILED

        return await self._run(_STRAIGHT, drive()) == _DONE

    def stop_navigate_to(self) -> None:
        """Brakes."""
        self._moves.stop_move()

    @with_caller
    async def move_along(self, caller: Caller, trajectory: Any) -> bool:
        """Moves along a trajectory; returns whether it reached the end.

        Args:
            caller: The calling client.
            trajectory: `["Holonomic", path, theta, seconds]`, or `["Composed", ...]` of several,
                each from the end of the last one. A path is `["Line", [x, y]]`,
                `["Circle", [x, y], angle]` around a centre, or `["Composed", ...]` [m, rad].
        """
        parts = _moves_along(trajectory)

        async def drive() -> int:
            for points, seconds in parts:
                if not await self._moves.move_to(caller, points, seconds):
                    return _FAILED
            return _DONE

        return await self._run(_ALONG, drive()) == _DONE

    async def find_free_zone(self, radius: float, farthest: float) -> list[Any]:
        """Looks for a free circle; what the lasers do not hit counts as free.

        Args:
            radius: Of the free circle [m].
            farthest: Its largest distance from the base [m].

        Returns:
            0, or 1 if there is none; the free radius found [m]; x and y of the nearest such place,
            else of that with the largest radius, in the world [m].
        """
        number(radius, "the radius")
        if not 0.0 <= number(farthest, "the distance") <= EXTENT:
            raise ValueError(f"the distance is {farthest:g} m; it must be in [0, {EXTENT:g}]")
        scan = await self._look()
        steps = CELL * np.arange(-np.floor(farthest / CELL), np.floor(farthest / CELL) + 1)
        places = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        away = np.linalg.norm(places, axis=1)
        places, away = places[away <= farthest], away[away <= farthest]
        hits = scan.ends[scan.hits]
        room = np.full(len(places), np.inf)
        if len(hits):
            room = np.asarray(spatial.KDTree(hits).query(places)[0])
        is_free: Mask = room >= radius
        found = bool(is_free.any())
        best = int(np.argmin(np.where(is_free, away, np.inf)) if found else np.argmax(room))
        x, y = transformed(self._moves.state.base_pose, places[best][None])[0]
        there = [float(x), float(y)]
        return [_DONE if found else _FAILED, min(float(room[best]), radius), there]

    get_free_zone = find_free_zone

    def start_free_zone_update(self) -> None:
        """Would gather what the lasers see; `stopAndComputeFreeZone` takes what they see then."""
        self._is_gathering = True

    async def stop_and_compute_free_zone(self, radius: float, farthest: Any) -> list[Any]:
        """As `findFreeZone`, 1 where `startFreeZoneUpdate` was not called before."""
        if not self._is_gathering:
            return [_FAILED, 0.0, [0.0, 0.0]]
        self._is_gathering = False
        farthest = farthest[0] if isinstance(farthest, list | tuple) and farthest else farthest
        return await self.find_free_zone(radius, farthest)

    @with_caller
    async def explore(self, caller: Caller, radius: float) -> int:
        """Maps the floor within a radius [m]; returns 0, or 1 if it was stopped or blocked."""
        if not 0.0 < number(radius, "radius") <= EXTENT:
            raise ValueError(
                f"the radius is {radius:g} m; it must be above 0 and at most {EXTENT:g}"
            )
        return await self._run(_EXPLORING, self._explore(caller, radius))

    def stop_exploration(self) -> None:
        """Stops an exploration; its map is kept."""
        if self._work is not None and self._work.get_name() == _EXPLORING:
            self._moves.stop_move()

    async def save_exploration(self) -> str:
        """Writes the map; returns its path."""
        known = self._known()
        now = datetime.fromtimestamp(self._timer.now, UTC)
        name = f"{now:%Y-%m-%dT%H%M%S}.{now.microsecond // 1000:03d}Z.explo"
        path, place = self._disk.place(_FOLDER, name)
        try:
            await asyncio.to_thread(write_floor_map, known, place)
        except InputError as error:
            raise ValueError(_with_path(error, path, place)) from None
        self._path = path
        return path

    async def load_exploration(self, path: str) -> int:
        """Reads a map; the robot's current pose is taken as its origin; returns 0."""
        where = PurePosixPath(path)
        path, place = self._disk.place(str(PurePosixPath(_FOLDER) / where.parent), where.name)
        if not place.is_file():
            raise ValueError(f"there is no exploration {path}")
        return await self._run("loadExploration", self._load(path, place))

    def get_exploration_path(self) -> str:
        """Returns the path of the map that was saved or loaded."""
        if not self._path:
            raise ValueError("no exploration was saved or loaded")
        return self._path

    async def get_metrical_map(self) -> list[Any]:
        """Returns metres per pixel, width, height, x and y of the top left, and the pixels.

        A pixel is 0 for free, 100 for occupied, and 50 for unknown.
        """
        known = self._known()
        rows, columns = known.log_odds.shape
        x, y = known.origin
        top_left = [float(x), float(y + rows * CELL)]
        percent = await asyncio.to_thread(known.percent)
        return [CELL, columns, rows, top_left, Typed("[m]", percent.ravel())]

    async def start_localization(self) -> None:
        """Localizes the robot in the map, near its estimated pose."""
        await self._run("startLocalization", self._localize(self._pose()))

    def stop_localization(self) -> None:
        """Discards the robot's pose in the map."""
        self._is_localized = False

    async def relocalize_in_map(self, guess: Sequence[float]) -> list[list[float]]:
        """Localizes the robot in the map near a guess: x, y and optionally theta [m, rad]."""
        known = self._known()
        x, y, *rest = numbers(guess, len(guess) if len(guess) in (2, 3) else 3, "the pose")
        if not known.contains((x, y)):
            raise ValueError(f"the place {x:g}, {y:g} is not on the map")
        theta = rest[0] if rest else float(self._pose()[2])
        await self._run("relocalizeInMap", self._localize(np.array([x, y, theta])))
        return self.get_robot_position_in_map()

    def get_robot_position_in_map(self) -> list[list[float]]:
        """Returns x, y, theta in the map [m, rad], and the uncertainty of each."""
        if not self._is_localized:
            raise ValueError(_NOT_LOCALIZED)
        return [self._pose().tolist(), [CELL, CELL, CELL]]

    @with_caller
    async def navigate_to_in_map(self, caller: Caller, goal: Sequence[float]) -> int:
        """Drives to x, y, theta in the map [m, rad]; returns 0, or 1 if it did not arrive."""
        target = numbers(goal, 3, "the pose")
        if not self._is_localized:
            raise ValueError(_NOT_LOCALIZED)
        return await self._run(_IN_MAP, self._navigate(caller, self._known(), target))

    async def _run(self, name: str, work: Coroutine[Any, Any, int]) -> int:
        """Runs work as the only one; returns its result, or 1 if it was stopped.

        Raises:
            ValueError: Other work is running.
        """
        if self._work is not None:
            work.close()
            raise ValueError(f"{self._work.get_name()} is already running")
        task = self._work = asyncio.get_running_loop().create_task(work, name=name)
        try:
            await asyncio.wait({task})
            return _FAILED if task.cancelled() else task.result()
        finally:
            task.cancel()  # If its caller cancelled the call or has disconnected.
            self._work = None

    def _stop(self) -> None:
        """Cancels work that drives the base."""
        if self._work is not None and self._work.get_name() in _DRIVES:
            self._work.cancel()

    async def _explore(self, caller: Caller, radius: float) -> int:
        self._scan()
        known = FloorMap()
        self._X_WM = np.array(self._moves.state.base_pose)
        self._map, self._path, self._is_localized = known, "", False
        # Visited places are not visited again, so that the exploration ends.
        looked_from: list[Vector] = []

        async def look() -> FloorMap:
            nonlocal known
            known = self._map = await self._add_scan(known, await self._look())
            return known

        while True:
            for turn in _AROUND:
                if turn and not await self._moves.move_to(caller, 0.0, 0.0, turn):
                    return _FAILED
                await look()
            here = self._pose()
            looked_from.append(here[:2])
            waypoints = await asyncio.to_thread(known.frontier, here, radius, looked_from)
            if waypoints is None:
                return _DONE
            looked_from.append(waypoints[-1])
            if not await self._follow(caller, waypoints, look):
                return _FAILED

    async def _load(self, path: str, place: Path) -> int:
        try:
            known = await asyncio.to_thread(read_floor_map, place)
        except InputError as error:
            raise ValueError(f"not an exploration: {_with_path(error, path, place)}") from None
        self._map, self._path, self._is_localized = known, path, False
        self._X_WM = np.array(self._moves.state.base_pose)
        return _DONE

    async def _navigate(self, caller: Caller, known: FloorMap, target: list[float]) -> int:
        for _ in range(_MOST_PLANS):
            scan = await self._look()
            await self._locate(known, scan, self._pose())
            seen = await self._add_scan(known, scan)

            async def look() -> FloorMap:
                nonlocal seen
                seen = await self._add_scan(seen, await self._look())
                return seen

            waypoints = await asyncio.to_thread(seen.path, self._pose(), target)
            if waypoints is None or not await self._follow(caller, waypoints, look):
                return _FAILED
            x, y, theta = self._pose()
            if math.hypot(target[0] - x, target[1] - y) < CELL:
                turn = math.remainder(target[2] - theta, 2 * math.pi)
                return _DONE if await self._moves.move_to(caller, 0.0, 0.0, turn) else _FAILED
        return _FAILED

    async def _follow(self, caller: Caller, waypoints: list[Vector], look: Look) -> bool:
        """Drives along waypoints until the end, or until the path is seen to be blocked.

        Returns whether all moves succeeded.
        """
        for point in waypoints:
            x, y, theta = self._pose()
            ahead = math.atan2(point[1] - y, point[0] - x)
            turn = math.remainder(ahead - theta, 2 * math.pi)
            if not await self._moves.move_to(caller, 0.0, 0.0, turn):
                return False
            seen = await look()
            here = self._pose()
            if not await asyncio.to_thread(seen.leads_straight, here, point):
                return True  # Blocked: the caller plans another path.
            distance = math.hypot(point[0] - here[0], point[1] - here[1])
            if not await self._moves.move_to(caller, distance, 0.0, 0.0):
                return False
        return True

    async def _look(self) -> LaserScan:
        """Waits for a scan taken at rest."""
        await self._timer.sleep(2 * PERIOD)
        return self._scan()

    async def _add_scan(self, known: FloorMap, scan: LaserScan) -> FloorMap:
        """Returns a map updated with a scan from the base's current pose."""
        return await asyncio.to_thread(known.with_scan, scan, self._pose())

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
        """Returns the base's pose in the map."""
        return composed(inverted(self._X_WM), self._moves.state.base_pose)

    def _set_pose(self, pose: Vector, base_pose: Sequence[float]) -> None:
        """Aligns the map so that a pose in the map is the base's pose by odometry."""
        self._X_WM = composed(base_pose, inverted(pose))

    async def _localize(self, guess: Vector) -> int:
        """Localizes the robot in the map near a guess.

        Raises:
            ValueError: The scan does not match the map there.
        """
        self._is_localized = False
        if not await self._locate(self._known(), self._scan(), guess):
            x, y, theta = guess
            raise ValueError(
                f"what the lasers see does not fit the map near {x:.2f}, {y:.2f}, {theta:.2f}"
            )
        self._is_localized = True
        return _DONE

    async def _locate(self, known: FloorMap, scan: LaserScan, guess: Vector) -> bool:
        """Corrects the pose in the map by a scan from here; returns whether the scan matches it.

        If it does not, the pose continues by odometry.
        """
        base_pose = self._moves.state.base_pose
        pose, mismatch = await asyncio.to_thread(known.matched, scan, guess)
        if not mismatch < _WORST_MATCH:
            return False
        self._set_pose(pose, base_pose)
        return True


def _moves_along(trajectory: Any) -> list[tuple[list[list[float]], float]]:
    """Returns the waypoints and the duration of each part of a trajectory [m, rad, s].

    Raises:
        ValueError: It is not a trajectory.
    """
    kind, *parts = trajectory if isinstance(trajectory, list | tuple) and trajectory else ("",)
    if kind == "Composed" and parts:
        return [move for part in parts for move in _moves_along(part)]
    if kind != "Holonomic" or len(parts) != 3:
        raise ValueError(
            'a trajectory is ["Holonomic", path, theta, seconds] or "Composed" of them'
        )
    path, theta, seconds = parts
    places = _places(path, np.zeros(2))
    turn = number(theta, "theta")
    points = [[x, y, turn * (k + 1) / len(places)] for k, (x, y) in enumerate(places)]
    if not number(seconds, "the time") > 0.0:
        raise ValueError(f"the time is {seconds:g} s; it must be above 0")
    return [(points, float(seconds))]


def _places(path: Any, start: Vector) -> list[list[float]]:
    """Returns the waypoints (2,) of a path from a start, all in one frame [m]."""
    kind, *parts = path if isinstance(path, list | tuple) and path else ("",)
    if kind == "Line" and len(parts) == 1:
        return [(start + numbers(parts[0], 2, "the end of a line")).tolist()]
    if kind == "Circle" and len(parts) == 2:
        center = np.array(numbers(parts[0], 2, "the centre of a circle"))
        turns = number(parts[1], "the angle") * np.arange(1, _CIRCLE_POINTS + 1) / _CIRCLE_POINTS
        around = [transformed((0.0, 0.0, turn), -center[None])[0] for turn in turns]
        return [(start + center + place).tolist() for place in around]
    if kind != "Composed" or not parts:
        raise ValueError('a path is ["Line", [x, y]], ["Circle", [x, y], angle] or "Composed"')
    places: list[list[float]] = []
    for part in parts:
        places += _places(part, np.array(places[-1]) if places else start)
    return places


def _with_path(error: InputError, path: str, place: Path) -> str:
    """Returns an error of a file with the robot's name of the file."""
    return str(error).replace(str(place), path)
