"""ALMotion's switches of protections, reflexes and idle movements: stored and returned."""

from typing import Any

from pepper_drake.naoqi.constants import CHAINS
from pepper_drake.robot_server.services.motion_arguments import settings

_PROTECTED = ("All", "Move", "Arms", "LArm", "RArm")
_SELF_PROTECTED = ("Arms", "LArm", "RArm")
_IDLE = ("Body", "Legs", "Arms", "LArm", "RArm", "Head", *CHAINS)


class MotionSettings:
    """Switches of ALMotion.

    The simulated robot neither breathes nor slows its arms near obstacles; the switches only store
    what programs set.

    Attributes:
        protected: External-collision protection by name.
    """

    def __init__(self) -> None:
        self.protected = dict.fromkeys(_PROTECTED, True)
        self._self_protected = dict.fromkeys(_SELF_PROTECTED, True)
        self._breathing = dict.fromkeys(_IDLE, False)
        self._idle = dict.fromkeys(_IDLE, False)
        self._breath_config: dict[str, float] = {"Bpm": 12.0, "Amplitude": 0.1}
        self._arms_move = {"LArm": True, "RArm": True}
        self._distances = {"orthogonal": 0.4, "tangential": 0.1}
        self._switches = dict.fromkeys(
            ("fall manager", "push recovery", "smart stiffness", "diagnosis", "notifications"),
            True,
        )

    def set_collision_protection_enabled(self, chain: str, enabled: bool) -> bool:
        """Switches the arms' protection from the body; returns True."""
        names = _SELF_PROTECTED if chain == "Arms" else (chain,)
        self._self_protected |= dict.fromkeys(_known(names, self._self_protected), enabled)
        return True

    def get_collision_protection_enabled(self, chain: str) -> bool:
        """Returns whether an arm's protection from the body is on."""
        return self._self_protected[_known((chain,), self._self_protected)[0]]

    def set_external_collision_protection_enabled(self, name: str, enabled: bool) -> None:
        """Switches the protection from what the robot sees."""
        names = {"All": _PROTECTED, "Arms": ("Arms", "LArm", "RArm")}.get(name, (name,))
        self.protected |= dict.fromkeys(_known(names, self.protected), enabled)

    def get_external_collision_protection_enabled(self, name: str) -> bool:
        """Returns whether the protection from what the robot sees is on."""
        return self.protected[_known((name,), self.protected)[0]]

    def is_collision(self, chain: str) -> str:
        """Returns "none": self-collisions of the simulated body are not checked."""
        _known((chain,), self._self_protected)
        return "none"

    def set_orthogonal_security_distance(self, distance: float) -> None:
        """Sets the base's distance to keep ahead [m]."""
        self._distances["orthogonal"] = _distance(distance)

    def get_orthogonal_security_distance(self) -> float:
        """Returns the base's distance to keep ahead [m]."""
        return self._distances["orthogonal"]

    def set_tangential_security_distance(self, distance: float) -> None:
        """Sets the base's distance to keep at its sides [m]."""
        self._distances["tangential"] = _distance(distance)

    def get_tangential_security_distance(self) -> float:
        """Returns the base's distance to keep at its sides [m]."""
        return self._distances["tangential"]

    def set_fall_manager_enabled(self, enabled: bool) -> None:
        """Switches the fall manager."""
        self._switches["fall manager"] = enabled

    def get_fall_manager_enabled(self) -> bool:
        """Returns whether the fall manager is on."""
        return self._switches["fall manager"]

    def set_push_recovery_enabled(self, enabled: bool) -> None:
        """Switches push recovery."""
        self._switches["push recovery"] = enabled

    def get_push_recovery_enabled(self) -> bool:
        """Returns whether push recovery is on."""
        return self._switches["push recovery"]

    def set_smart_stiffness_enabled(self, enabled: bool) -> None:
        """Switches the motors' saving of current."""
        self._switches["smart stiffness"] = enabled

    def get_smart_stiffness_enabled(self) -> bool:
        """Returns whether the motors save current."""
        return self._switches["smart stiffness"]

    def set_diagnosis_effect_enabled(self, enabled: bool) -> None:
        """Switches the effects of the diagnosis."""
        self._switches["diagnosis"] = enabled

    def get_diagnosis_effect_enabled(self) -> bool:
        """Returns whether the diagnosis has effects."""
        return self._switches["diagnosis"]

    def set_enable_notifications(self, enabled: bool) -> None:
        """Switches notifications."""
        self._switches["notifications"] = enabled

    def are_notifications_enabled(self) -> bool:
        """Returns whether notifications are on."""
        return self._switches["notifications"]

    def set_breath_enabled(self, chain: str, enabled: bool) -> None:
        """Switches breathing of a chain."""
        self._breathing |= dict.fromkeys(_known((chain,), self._breathing), enabled)

    def get_breath_enabled(self, chain: str) -> bool:
        """Returns whether a chain's breathing is on."""
        return self._breathing[_known((chain,), self._breathing)[0]]

    def set_breath_config(self, config: Any) -> None:
        """Sets how the robot breathes, [[key, value], ...]."""
        self._breath_config |= settings(config)

    def get_breath_config(self) -> list[list[Any]]:
        """Returns how the robot breathes."""
        return [[key, value] for key, value in self._breath_config.items()]

    def set_idle_posture_enabled(self, chain: str, enabled: bool) -> None:
        """Switches the idle posture of a chain."""
        self._idle |= dict.fromkeys(_known((chain,), self._idle), enabled)

    def get_idle_posture_enabled(self, chain: str) -> bool:
        """Returns whether a chain's idle posture is on."""
        return self._idle[_known((chain,), self._idle)[0]]

    def set_move_arms_enabled(self, left: bool, right: bool) -> None:
        """Switches the arms' swing as the base moves; Pepper's do not swing."""
        self._arms_move = {"LArm": left, "RArm": right}

    def get_move_arms_enabled(self, chain: str) -> bool:
        """Returns whether an arm may swing as the base moves."""
        if chain == "Arms":
            return all(self._arms_move.values())
        return self._arms_move[_known((chain,), self._arms_move)[0]]

    def set_walk_arms_enabled(self, left: bool, right: bool) -> None:
        """As `setMoveArmsEnabled`, its name on NAO."""
        self.set_move_arms_enabled(left, right)

    def get_walk_arms_enabled(self) -> list[bool]:
        """Returns whether left and right arm may swing."""
        return list(self._arms_move.values())

    def set_motion_config(self, _config: Any) -> None:
        """Accepts a configuration without effect."""


def _known(names: tuple[str, ...], table: dict[str, bool]) -> tuple[str, ...]:
    for name in names:
        if name not in table:
            raise ValueError(f"there is no chain {name!r}; it must be one of {', '.join(table)}")
    return names


def _distance(distance: float) -> float:
    if not 0.0 <= distance < 10.0:
        raise ValueError(f"the distance is {distance:g} m; it must be from 0 to 10")
    return distance
