"""The service directory: our services and those registered by clients."""

import itertools
import os
import uuid
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pepper_drake.robot_server.wire.connection import Connection
from pepper_drake.robot_server.wire.objects import ClientObject
from pepper_drake.robot_server.wire.service import Caller, Service, ServiceError

SERVICE_INFO = (
    "(sIsI[s]ss)<ServiceInfo,name,serviceId,machineId,processId,endpoints,sessionId,objectUid>"
)
DIRECTORY = 1
"""Number of the directory itself."""
_SERVICES = 256
"""Most services registered by clients."""


@dataclass
class _Entry:
    info: tuple[Any, ...]
    service: Service | None
    owner: Connection | None = None
    ready: bool = True


class Directory:
    """Service 1 of a server.

    Attributes:
        service: The directory as a service.
        session: Number that a reboot changes.
    """

    def __init__(
        self, endpoints: Callable[[Caller], list[str]], connection: Callable[[Caller], Connection]
    ) -> None:
        """Makes a directory that holds only itself.

        Args:
            endpoints: Addresses of our services for a client.
            connection: The connection of a caller.
        """
        self._endpoints, self._connection = endpoints, connection
        self._machine = str(uuid.uuid4())
        self.session = 0
        self._numbers = itertools.count(DIRECTORY + 1)
        self._entries: dict[int, _Entry] = {}
        self.service = Service("ServiceDirectory", "NAOqi's services by their names.")
        add = self.service.add_method
        add("service", "(s)", SERVICE_INFO, self._service, uid=100, wants_caller=True)
        add("services", "()", f"[{SERVICE_INFO}]", self._services, uid=101, wants_caller=True)
        add("registerService", f"({SERVICE_INFO})", "I", self._register, uid=102, wants_caller=True)
        add("unregisterService", "(I)", "v", self._unregister, uid=103, wants_caller=True)
        add("serviceReady", "(I)", "v", self._ready, uid=104, wants_caller=True)
        add("updateServiceInfo", f"({SERVICE_INFO})", "v", self._update, uid=105, wants_caller=True)
        self.service.add_signal("serviceAdded", "(Is)", uid=106)
        self.service.add_signal("serviceRemoved", "(Is)", uid=107)
        add("machineId", "()", "s", lambda: self._machine, uid=108)
        self._entries[DIRECTORY] = _Entry(self._info("ServiceDirectory", DIRECTORY), self.service)

    def add(self, service: Service) -> int:
        """Adds a service of ours and returns its number.

        Raises:
            ValueError: A service of that name exists.
        """
        if self._number(service.name) is not None:
            raise ValueError(f"{service.name} is there twice")
        number = next(self._numbers)
        self._entries[number] = _Entry(self._info(service.name, number), service)
        return number

    def services(self) -> list[Service]:
        """Returns our services, the directory first."""
        return [entry.service for entry in self._entries.values() if entry.service is not None]

    def by_number(self, number: int) -> Service | None:
        """Returns a service of ours by its number."""
        entry = self._entries.get(number)
        return None if entry is None else entry.service

    def has_client_service(self, name: str) -> bool:
        """Returns whether a client registered a service of this name."""
        number = self._number(name)
        return number is not None and self._entries[number].owner is not None

    async def find_client_service(self, name: str) -> ClientObject | None:
        """Returns a client's registered service, which is called over its connection."""
        number = self._number(name)
        entry = None if number is None else self._entries[number]
        if number is None or entry is None or entry.owner is None:
            return None
        return await entry.owner.client_service(number)

    def client_left(self, connection: Connection) -> None:
        """Removes the services registered by a client."""
        for number, entry in list(self._entries.items()):
            if entry.owner is connection:
                self._remove(number)

    def _info(self, name: str, number: int) -> tuple[Any, ...]:
        return (name, number, self._machine, os.getpid(), [], "0", "")

    def _number(self, name: str) -> int | None:
        return next((n for n, entry in self._entries.items() if entry.info[0] == name), None)

    def _info_for(self, caller: Caller, entry: _Entry) -> tuple[Any, ...]:
        """Returns an entry with the addresses for this client."""
        if entry.service is None:
            return entry.info
        return (*entry.info[:4], self._endpoints(caller), str(self.session), *entry.info[6:])

    def _service(self, caller: Caller, name: str) -> tuple[Any, ...]:
        number = self._number(name)
        if number is None or not self._entries[number].ready:
            raise ServiceError(f"Cannot find service '{name}' in index")
        return self._info_for(caller, self._entries[number])

    def _services(self, caller: Caller) -> list[tuple[Any, ...]]:
        return [self._info_for(caller, entry) for entry in self._entries.values() if entry.ready]

    def _register(self, caller: Caller, info: tuple[Any, ...]) -> int:
        name = info[0]
        if not name:
            raise ServiceError("a service needs a name")
        if self._number(name) is not None:
            raise ServiceError(f"Service '{name}' is already registered")
        if sum(entry.owner is not None for entry in self._entries.values()) >= _SERVICES:
            raise ServiceError("too many services are registered")
        number = next(self._numbers)
        owner = self._connection(caller)
        told = (name, number, *info[2:])
        self._entries[number] = _Entry(told, None, owner, ready=False)
        return number

    def _ready(self, caller: Caller, number: int) -> None:
        entry = self._owned(caller, number)
        entry.ready = True
        self.service.emit("serviceAdded", number, entry.info[0])

    def _update(self, caller: Caller, info: tuple[Any, ...]) -> None:
        entry = self._owned(caller, info[1])
        entry.info = (entry.info[0], entry.info[1], *info[2:])

    def _unregister(self, caller: Caller, number: int) -> None:
        self._owned(caller, number)
        self._remove(number)

    def _owned(self, caller: Caller, number: int) -> _Entry:
        entry = self._entries.get(number)
        if entry is None or entry.owner is None or entry.owner.caller.client != caller.client:
            raise ServiceError(f"Can't find service #{number}")
        return entry

    def _remove(self, number: int) -> None:
        entry = self._entries.pop(number)
        if entry.ready:
            self.service.emit("serviceRemoved", number, entry.info[0])
