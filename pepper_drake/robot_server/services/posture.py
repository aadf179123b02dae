"""ALRobotPosture: motion to named postures, and their recognition."""

from collections.abc import Callable
from typing import Any

import numpy as np

from pepper_drake.naoqi.constants import HANDS, JOINTS
from pepper_drake.robot_server.robot.robot_model import clip_to_limits
from pepper_drake.robot_server.services.motion import Motion
from pepper_drake.robot_server.services.motion_arguments import fraction
from pepper_drake.robot_server.services.postures import NAOQI_POSTURES, POSTURE_FAMILIES
from pepper_drake.robot_server.services.waiting import Module

_LIKENESS = 0.2
"""Largest difference of any joint from a recognised posture [rad]."""

_TASK = "goToPosture"


class Posture(Module):
    """ALRobotPosture."""

    def __init__(self, motion: Motion, raise_event: Callable[[str, Any], None]) -> None:
        super().__init__("ALRobotPosture")
        self._motion = motion
        self._raise_event = raise_event
        self._last_raised = ("", "")

    async def go_to_posture(self, name: str, max_speed_fraction: float) -> bool:
        """Goes to a posture, waking up if asleep; False if it is unknown or was interrupted."""
        if name not in NAOQI_POSTURES:
            return False
        share = fraction(max_speed_fraction)
        if not self._motion.robot_is_wake_up():
            await self._motion.wake_up()
        return await self._motion.go_to(NAOQI_POSTURES[name], share, _TASK)

    async def apply_posture(self, name: str, max_speed_fraction: float) -> bool:
        """As `goToPosture`, which always moves directly."""
        return await self.go_to_posture(name, max_speed_fraction)

    def stop_move(self) -> None:
        """Stops going to a posture."""
        self._motion.tasks.kill_where(lambda task: task.name == _TASK)

    def get_posture(self) -> str:
        """Returns the robot's posture, or "Unknown"."""
        measured = self._motion.state.positions
        arms_and_body = [k for k, name in enumerate(JOINTS) if name not in HANDS]
        for name, posture in NAOQI_POSTURES.items():
            wanted = clip_to_limits(np.array([posture[joint] for joint in JOINTS]))
            if np.max(np.abs(measured - wanted)[arms_and_body]) < _LIKENESS:
                return name
        return "Unknown"

    def get_posture_family(self) -> str:
        """Returns the family of the posture, by the hip if the posture is unknown."""
        family = POSTURE_FAMILIES.get(self.get_posture())
        if family is not None:
            return family
        hip = self._motion.state.positions[JOINTS.index("HipPitch")]
        return "Crouching" if hip < -0.7 else "Standing"

    def get_posture_list(self) -> list[str]:
        """Returns the names of the postures."""
        return list(NAOQI_POSTURES)

    def get_posture_family_list(self) -> list[str]:
        """Returns the names of the families."""
        return sorted(set(POSTURE_FAMILIES.values()))

    def set_max_try_number(self, _number: int) -> None:
        """Has no effect: there is only one try."""

    def step(self) -> None:
        """Raises events when posture or family have changed."""
        now = (self.get_posture(), self.get_posture_family())
        for event, before, after in zip(
            ("PostureChanged", "PostureFamilyChanged"), self._last_raised, now, strict=True
        ):
            if before != after:
                self._raise_event(event, after)
        self._last_raised = now
