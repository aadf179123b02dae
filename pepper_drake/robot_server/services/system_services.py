"""Resources, networks, modules, logs and preferences of the robot's system."""

import os
from collections.abc import Callable
from typing import Any

from pepper_drake.robot_server.services.extractors import Extractor
from pepper_drake.robot_server.services.kept_settings import keep_settings
from pepper_drake.robot_server.services.waiting import VERSION, Module

Log = Callable[[str], None]


class System(Module):
    """ALSystem."""

    def __init__(self) -> None:
        super().__init__("ALSystem")
        keep_settings(self, {"set_robot_name": ("robot_name", "Pepper")}, True)
        keep_settings(self, {"set_timezone": ("timezone", "Europe/Paris")}, True)

    def system_version(self) -> str:
        """Returns the version of NAOqi."""
        return VERSION

    def previous_system_version(self) -> str:
        """Returns the previous version: none."""
        return ""

    def total_memory(self) -> int:
        """Returns the memory of the machine that simulates the robot [kB]."""
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") // 1024

    def free_memory(self) -> int:
        """Returns the free memory of the machine that simulates the robot [kB]."""
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_AVPHYS_PAGES") // 1024

    def robot_icon(self) -> bytes:
        """Returns a picture of the robot: none."""
        return b""

    def _refused(self, *_: Any) -> None:
        """Refuses: the simulated robot is started and stopped on its own machine."""
        raise ValueError(
            "a simulated robot is started and stopped on its own machine, not remotely"
        )

    reboot = _refused
    shutdown = _refused
    upgrade = _refused
    factory_reset = _refused
    change_password = _refused


class Sensors(Extractor):
    """ALSensors: subscribers of events of bumpers and buttons, which are always raised."""

    def __init__(self) -> None:
        super().__init__("ALSensors", keys=("LeftBumperPressed", "RightBumperPressed"))

    def run(self) -> None:
        """Has no effect: the events are always raised."""


class ResourceManager(Module):
    """ALResourceManager: owners of resources by name, without enforcement."""

    def __init__(self) -> None:
        super().__init__("ALResourceManager")
        self._parents = dict.fromkeys(_RESOURCES, "")
        self._owners: dict[str, str] = {}

    def create_resource(self, name: str, parent: str) -> None:
        """Creates a resource, within another one or ""."""
        if name in self._parents:
            raise ValueError(f"the resource {name} already exists")
        if parent:
            self._known(parent)
        self._parents[name] = parent

    def create_resources_list(self, names: list[str], parent: str) -> None:
        """Creates resources."""
        for name in names:
            self.create_resource(name, parent)

    def delete_resource(self, name: str, children: bool) -> None:
        """Deletes a resource, with those in it if `children`."""
        self._known(name)
        within = [child for child in self._parents if self.is_in_group(name, child)]
        if len(within) > 1 and not children:
            raise ValueError(f"the resource {name} contains other resources")
        for child in within:
            del self._parents[child]
            self._owners.pop(child, None)

    def get_resources(self) -> list[str]:
        """Returns the resources."""
        return list(self._parents)

    def owners_get(self) -> list[list[str]]:
        """Returns [resource, owner] for each owned resource."""
        return [[name, owner] for name, owner in self._owners.items()]

    def is_in_group(self, group: str, name: str) -> bool:
        """Returns whether a resource is a group or within it."""
        self._known(name)
        while name:
            if name == group:
                return True
            name = self._parents[name]
        return False

    def is_resource_free(self, name: str) -> bool:
        """Returns whether a resource, those in it and those containing it have no owner."""
        self._known(name)
        return not any(
            self.is_in_group(name, owned) or self.is_in_group(owned, name) for owned in self._owners
        )

    def are_resources_free(self, names: list[str]) -> bool:
        """Returns whether all these resources are free."""
        return all(self.is_resource_free(name) for name in names)

    def check_state_resource_free(self, names: list[str]) -> bool:
        """As `areResourcesFree`: states are ignored."""
        return self.are_resources_free(names)

    def are_resources_owned_by(self, names: list[str], owner: str) -> bool:
        """Returns whether all these resources have one owner."""
        return all(self._owners.get(name) == owner for name in names)

    def acquire_resource(self, name: str, owner: str, _callback: str, _seconds: int) -> None:
        """Acquires a resource for an owner; refused while another has it."""
        self.acquire_resources_tree([name], owner, "", 0)

    def acquire_resources_tree(
        self, names: list[str], owner: str, _callback: str, _seconds: int
    ) -> None:
        """Acquires resources for an owner; refused while another has one of them."""
        taken = [
            name
            for name in names
            if not self.is_resource_free(name) and self._owners.get(name) != owner
        ]
        if taken:
            raise ValueError(f"{', '.join(taken)} belong to another module")
        self._owners |= dict.fromkeys(names, owner)

    wait_for_resource = acquire_resource
    wait_for_resources_tree = acquire_resources_tree

    def wait_for_optional_resources_tree(
        self, names: list[str], owner: str, callback: str, seconds: int, optional: list[str]
    ) -> list[str]:
        """Acquires resources for an owner, and the free optional ones; returns these."""
        self.acquire_resources_tree(names, owner, callback, seconds)
        free = [name for name in optional if self.is_resource_free(name)]
        self._owners |= dict.fromkeys(free, owner)
        return free

    def release_resource(self, name: str, owner: str) -> None:
        """Releases a resource of an owner."""
        self.release_resources([name], owner)

    def release_resources(self, names: list[str], owner: str) -> None:
        """Releases resources of an owner."""
        for name in names:
            self._known(name)
            if self._owners.get(name) == owner:
                del self._owners[name]

    def enable_state_resource(self, name: str, _enabled: bool) -> None:
        """Only checks that the resource exists."""
        self._known(name)

    def _known(self, name: str) -> None:
        if name not in self._parents:
            raise ValueError(f"there is no resource {name!r}")


_RESOURCES = ("All motors", "Head", "LArm", "RArm", "Leg", "Wheels", "All leds", "TTS", "Standing")


class ConnectionManager(Module):
    """ALConnectionManager: the simulated robot is in the network of the machine that it runs on."""

    def __init__(self) -> None:
        super().__init__("ALConnectionManager")
        keep_settings(self, {"set_country": ("country", "FR")})

    def state(self) -> str:
        """Returns the state of the network."""
        return "ready"

    def scan(self, _technology: str = "") -> None:
        """Scans for networks; has no effect."""

    def services(self) -> list[list[list[Any]]]:
        """Returns the networks, each as [[name, value], ...]."""
        return [self.service(_NETWORK)]

    def service(self, name: str) -> list[list[Any]]:
        """Returns a network as [[name, value], ...]."""
        if name != _NETWORK:
            raise ValueError(f"there is no network {name!r}")
        about = {"ServiceId": name, "Name": "Wired", "Type": "ethernet", "State": "online"}
        return [[key, value] for key, value in {**about, "Favorite": True}.items()]

    def technologies(self) -> list[str]:
        """Returns the kinds of network that it has."""
        return ["ethernet"]

    def interfaces(self) -> list[list[str]]:
        """Returns names and addresses of network interfaces: none are disclosed."""
        return []

    def countries(self) -> list[str]:
        """Returns the countries that can be set."""
        return ["DE", "FR", "GB", "JP", "US"]

    def get_tethering_enable(self, _technology: str) -> bool:
        """Returns whether tethering is on: it is not."""
        return False

    def _refused(self, *_: Any) -> None:
        """Refuses: the network is the machine's."""
        raise ValueError("the network is that of the machine on which the robot is simulated")

    connect = _refused
    disconnect = _refused
    forget = _refused
    set_service_configuration = _refused
    set_service_input = _refused
    enable_tethering = _refused
    disable_tethering = _refused
    tethering_name = _refused
    tethering_passphrase = _refused


_NETWORK = "ethernet_simulated"


class Launcher(Module):
    """ALLauncher: lists the modules; it starts nothing."""

    def __init__(self, modules: Callable[[], list[str]]) -> None:
        super().__init__("ALLauncher")
        self._modules = modules

    def is_module_present(self, name: str) -> bool:
        """Returns whether there is a module."""
        return name in self._modules()

    def get_global_module_list(self) -> list[str]:
        """Returns the modules."""
        return self._modules()

    def _refused(self, name: str, *_: Any) -> None:
        """Refuses: nothing can be started on the simulated robot."""
        raise ValueError(f"{name!r} is not on the simulated robot, and nothing is started")

    launch_local = _refused
    launch_executable = _refused
    launch_script = _refused
    launch_python_module = _refused


class ServiceManager(Module):
    """ALServiceManager: nothing is installed that could be started."""

    def __init__(self) -> None:
        super().__init__("ALServiceManager")

    def services(self) -> list[Any]:
        """Returns the services of packages: none."""
        return []

    def _is_not(self, _name: str) -> bool:
        """Returns False: there is no such service."""
        return False

    start_service = _is_not
    restart_service = _is_not
    stop_service = _is_not
    is_service_running = _is_not


class Logger(Module):
    """ALLogger: messages of clients' modules in the robot's log."""

    def __init__(self, log: Log) -> None:
        super().__init__("ALLogger")
        self._log = log
        keep_settings(self, {"set_verbosity": ("verbosity_name", "info")})

    def verbosity(self) -> int:
        """Returns the verbosity, from 0 to 6."""
        name = self.verbosity_name()  # type: ignore[attr-defined]
        return _LEVELS.index(name) if name in _LEVELS else _LEVELS.index("info")

    def _say(self, module: str, text: str) -> None:
        """Writes a line to the log."""
        self._log(f"{module}: {text}")

    fatal = error = warn = info = _say

    def _quiet(self, *_: Any) -> None:
        """Has no effect."""

    debug = low_debug = low_info = _quiet
    log_in_file = log_in_forwarder = log_in_std = log_in_sys = _quiet
    remove_handler = separator = set_filter = _quiet


_LEVELS = ("silent", "fatal", "error", "warning", "info", "verbose", "debug")


class Preferences(Module):
    """ALPreferences: preferences by file name, stored until the end (old API)."""

    def __init__(self) -> None:
        super().__init__("ALPreferences")
        self._files: dict[str, Any] = {}

    def read_pref_file(self, name: str, _save: bool) -> Any:
        """Returns the preferences of a file, an empty list if there is none."""
        return self._files.get(name, [])

    def write_pref_file(self, name: str, preferences: Any, _ignore: bool) -> None:
        """Stores preferences."""
        self._files[name] = preferences

    def remove_pref_file(self, name: str) -> None:
        """Removes preferences."""
        self._files.pop(name, None)

    def save_to_memory(self, _preferences: Any) -> bool:
        """Returns False: preferences are not stored in ALMemory."""
        return False


class Store(Module):
    """ALStore: without a store."""

    def __init__(self) -> None:
        super().__init__("ALStore")

    def update(self) -> None:
        """Refuses: there is no store."""
        raise ValueError("the simulated robot has no store to fetch programs from")

    def stop_update(self) -> None:
        """Has no effect: no update is running."""

    def status(self) -> list[Any]:
        """Returns the downloads: none."""
        return []


class Diagnosis(Module):
    """ALDiagnosis: all parts of the simulated robot work."""

    def __init__(self) -> None:
        super().__init__("ALDiagnosis")
        keep_settings(self, {"set_enable_notification": ("is_notification_enabled", True)})

    def get_diagnosis_status(self) -> list[Any]:
        """Returns the worst error, 0 for none, and its devices."""
        return [0, []]

    get_active_diagnosis = get_diagnosis_status
    get_passive_diagnosis = get_diagnosis_status
