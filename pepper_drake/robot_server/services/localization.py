"""ALLocalization and ALVisualCompass: poses relative to a home, and straight moves, by odometry.

A robot recognises its home by panoramas and its heading by a picture. The served robot trusts its
odometry, which is correct as long as nobody carries it.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from pepper_drake.robot_server.robot.floor_map import Vector, composed, inverted
from pepper_drake.robot_server.services.extractors import Looker
from pepper_drake.robot_server.services.kept_settings import keep_settings
from pepper_drake.robot_server.services.motion_arguments import numbers
from pepper_drake.robot_server.services.waiting import Module
from pepper_drake.robot_server.wire.service import Caller
from pepper_drake.robot_server.wire.signatures import with_caller

_MESSAGES = ("OK", "no home was learned", "the robot did not get there", "there is no such home")
_DONE, _NO_HOME, _NOT_THERE, _UNKNOWN = range(len(_MESSAGES))
_AT_HOME = 1.0
"""Distance from home within which the robot is at home [m], an assumption."""


class Localization(Module):
    """ALLocalization."""

    def __init__(self, moves: Any) -> None:
        """Makes the service without a home.

        Args:
            moves: ALMotion.
        """
        super().__init__("ALLocalization")
        self._moves = moves
        self._X_WH: Vector | None = None
        self._saved: dict[str, Vector] = {}

    def learn_home(self) -> int:
        """Sets the robot's current pose as home; returns 0."""
        self._X_WH = np.array(self._moves.state.base_pose)
        return _DONE

    @with_caller
    async def go_to_home(self, caller: Caller) -> int:
        """Drives home; returns 0, or an error code."""
        return await self.go_to_position(caller, [0.0, 0.0, 0.0])

    @with_caller
    async def go_to_position(self, caller: Caller, place: Sequence[float]) -> int:
        """Drives to x, y, theta relative to home [m, rad]; returns 0, or an error code."""
        X_HG = np.array(numbers(place, 3, "the place"))
        if self._X_WH is None:
            return _NO_HOME
        X_BG = composed(composed(inverted(self._moves.state.base_pose), self._X_WH), X_HG)
        there = await self._moves.move_to(caller, *X_BG.tolist())
        return _DONE if there else _NOT_THERE

    def get_robot_position(self, _look: bool = False) -> list[float]:
        """Returns the robot's pose relative to home: x, y [m], theta [rad]."""
        if self._X_WH is None:
            raise ValueError(_MESSAGES[_NO_HOME])
        return [float(v) for v in composed(inverted(self._X_WH), self._moves.state.base_pose)]

    def is_in_current_home(self) -> bool:
        """Returns whether the robot is at home."""
        return self._X_WH is not None and math.hypot(*self.get_robot_position()[:2]) < _AT_HOME

    def is_data_available(self) -> bool:
        """Returns whether a home was learned."""
        return self._X_WH is not None

    def is_relocalization_required(self) -> bool:
        """Returns whether odometry may be wrong: it is not."""
        return False

    def save(self, name: str) -> int:
        """Stores the home under a name until the end; returns 0, or an error code."""
        if self._X_WH is None:
            return _NO_HOME
        self._saved[name] = self._X_WH
        return _DONE

    def load(self, name: str) -> int:
        """Loads a stored home; returns 0, or an error code."""
        if name not in self._saved:
            return _UNKNOWN
        self._X_WH = self._saved[name]
        return _DONE

    def clear(self, name: str) -> int:
        """Removes a stored home; returns 0, or an error code."""
        return _DONE if self._saved.pop(name, None) is not None else _UNKNOWN

    def get_message_from_error_code(self, code: int) -> str:
        """Returns the meaning of an error code."""
        return _MESSAGES[code] if 0 <= code < len(_MESSAGES) else "unknown error"

    def stop_all(self) -> None:
        """Brakes."""
        self._moves.stop_move()


class VisualCompass(Looker):
    """ALVisualCompass: its moves, without comparison of pictures."""

    def __init__(self, moves: Any, log: Callable[[str], None]) -> None:
        """Makes the service.

        Args:
            moves: ALMotion.
            log: Takes a line when the first client subscribes.
        """
        super().__init__("ALVisualCompass", log, "VisualCompass/Deviation", "deviations")
        self._moves = moves
        self.move_to = moves.move_to
        keep_settings(self, {"enable_reference_refresh": ("is_reference_refreshed", True)})
        keep_settings(self, {"set_current_image_as_reference": ("get_reference", [])}, True)

    @with_caller
    async def move_straight_to(self, caller: Caller, x: float) -> bool:
        """Drives straight ahead [m]; returns whether it arrived."""
        return bool(await self._moves.move_to(caller, x, 0.0, 0.0))

    async def wait_until_target_reached(self) -> None:
        """Returns when the base is at rest."""
        await self._moves.wait_until_move_is_finished()
