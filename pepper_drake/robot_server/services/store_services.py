"""Preferences, packages, behaviours, laser, charging station: stored or empty."""

from collections.abc import Callable
from typing import Any

from pepper_drake.robot_server.services.kept_settings import keep_settings
from pepper_drake.robot_server.services.waiting import Module


class PreferenceManager(Module):
    """ALPreferenceManager: values by domain and name, stored until the robot ends."""

    def __init__(self) -> None:
        super().__init__("ALPreferenceManager")
        self._values: dict[str, dict[str, Any]] = {}

    def set_value(self, domain: str, name: str, value: Any) -> None:
        """Stores a value."""
        self._values.setdefault(domain, {})[name] = value

    def get_value(self, domain: str, name: str) -> Any:
        """Returns a value, or None."""
        return self._values.get(domain, {}).get(name)

    def get_value_list(self, domain: str) -> list[list[Any]]:
        """Returns the values of a domain as [[name, value], ...]."""
        return [[name, value] for name, value in self._values.get(domain, {}).items()]

    def get_domain_list(self) -> list[str]:
        """Returns the domains."""
        return sorted(self._values)

    def remove_value(self, domain: str, name: str) -> None:
        """Removes a value."""
        self._values.get(domain, {}).pop(name, None)

    def remove_domain_values(self, domain: str) -> None:
        """Removes the values of a domain."""
        self._values.pop(domain, None)

    def update(self) -> None:
        """Has no effect."""


class PackageManager(Module):
    """PackageManager: nothing is installed."""

    def __init__(self) -> None:
        super().__init__("PackageManager")

    def packages(self) -> list[Any]:
        """Returns the packages: none."""
        return []

    packages2 = packages

    get_packages = packages

    def _not_installed(self, name: str, *_: Any) -> Any:
        """Refuses: no package is installed."""
        raise ValueError(f"package {name!r} is not installed, and none can be")

    package = package2 = get_package = _not_installed
    package_icon = get_package_icon = _not_installed
    install = install_check_md5 = remove_pkg = _not_installed

    def has_package(self, _name: str) -> bool:
        """Returns whether a package is installed: none is."""
        return False


class BehaviorManager(Module):
    """ALBehaviorManager: no behaviour is installed, so none can be started."""

    def __init__(self) -> None:
        super().__init__("ALBehaviorManager")
        self._defaults: list[str] = []

    def _none(self, *_: Any) -> list[str]:
        """Returns no behaviours."""
        return []

    get_behavior_names = _none
    get_user_behavior_names = _none
    get_system_behavior_names = _none
    get_installed_behaviors = _none
    get_behaviors_by_tag = _none
    get_running_behaviors = _none
    get_loaded_behaviors = _none
    get_tag_list = _none
    get_behavior_tags = _none

    def _is_not(self, _name: str) -> bool:
        """Returns False: there is no behaviour."""
        return False

    is_behavior_installed = _is_not
    is_behavior_present = _is_not
    is_behavior_running = _is_not
    is_behavior_loaded = _is_not
    remove_behavior = _is_not
    preload_behavior = _is_not

    def start_behavior(self, name: str) -> None:
        """Refuses: no behaviour is installed."""
        raise ValueError(f"behavior {name!r} is not installed")

    def run_behavior(self, name: str) -> None:
        """As `startBehavior`."""
        self.start_behavior(name)

    def stop_behavior(self, _name: str) -> None:
        """Stops a behaviour; none runs."""

    def stop_all_behaviors(self) -> None:
        """Stops all behaviours; none runs."""

    def add_default_behavior(self, name: str) -> None:
        """Adds a behaviour to be started with the robot."""
        self._defaults.append(name)

    def remove_default_behavior(self, name: str) -> None:
        """Removes a behaviour to be started with the robot."""
        if name in self._defaults:
            self._defaults.remove(name)

    def get_default_behaviors(self) -> list[str]:
        """Returns the behaviours to be started with the robot."""
        return list(self._defaults)

    def play_default_project(self) -> None:
        """Has no effect: no behaviour is installed."""


class Laser(Module):
    """ALLaser: its settings; the values are in ALMemory, if they are simulated."""

    def __init__(self) -> None:
        super().__init__("ALLaser")
        keep_settings(self, {"set_opening_angle": ("get_opening_angle", [])})
        keep_settings(self, {"set_detecting_length": ("get_detecting_length", [])})

    def laser_on(self) -> None:
        """Switches the laser on."""

    def laser_off(self) -> None:
        """Switches the laser off."""


class Recharge(Module):
    """ALRecharge: without a charging station."""

    def __init__(self, raise_event: Callable[[str, Any], None]) -> None:
        super().__init__("ALRecharge")
        self._raise_event = raise_event
        keep_settings(self, {"set_use_tracker_searcher": ("get_use_tracker_searcher", True)})
        keep_settings(self, {"set_max_number_of_tries": ("get_max_number_of_tries", 3)})

    def look_for_station(self) -> list[Any]:
        """Returns False and no position: no station was found."""
        self._raise_event("ALRecharge/StationNotFound", True)
        return [False, []]

    def _not_found(self) -> int:
        """Returns the error code of no station."""
        self._raise_event("ALRecharge/StationNotFound", True)
        return 1

    move_in_front_of_station = _not_found
    dock_on_station = _not_found
    go_to_station = _not_found
    leave_station = _not_found

    def get_status(self) -> int:
        """Returns 0: idle."""
        return 0

    def get_station_position(self) -> list[float]:
        """Returns the station's position: unknown."""
        return []

    def stop_all(self) -> None:
        """Has no effect."""
