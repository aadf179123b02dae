"""ALMemory: values by key, events, and the keys of the robot's sensors."""

import asyncio
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from pepper_drake.naoqi.clock import split_time
from pepper_drake.robot_server.services.waiting import Module
from pepper_drake.robot_server.wire.service import (
    RemoteObject,
    Service,
    ServiceError,
    ServiceFinder,
)

_HISTORY = 100
"""Length of an event's history."""


@dataclass
class _Entry:
    value: Any
    time: float


class Memory(Module):
    """ALMemory.

    A key's value is stored, or computed by a function whenever it is read:
    the sensors' keys are functions of the robot's newest state.
    """

    def __init__(
        self, clock: Callable[[], float], finder: Callable[[], ServiceFinder | None]
    ) -> None:
        """Makes an empty memory.

        Args:
            clock: Returns the robot's time [s].
            finder: Returns the directory, for events that call a client's module, or None.
        """
        super().__init__("ALMemory")
        self._clock = clock
        self._finder = finder
        self._data: dict[str, _Entry] = {}
        self._computed: dict[str, Callable[[], Any]] = {}
        self._subscribers: dict[str, list[Service]] = {}
        self._modules: dict[str, dict[str, tuple[str, str]]] = {}
        self._listeners: list[tuple[str, Callable[[Any], None]]] = []
        self._history: dict[str, deque[list[Any]]] = {}
        self._descriptions: dict[str, str] = {}
        self._events: set[str] = set()
        self._pending: set[asyncio.Task[None]] = set()

    # For the other services.

    def compute(self, keys: Mapping[str, Callable[[], Any]]) -> None:
        """Sets the functions of computed keys."""
        self._computed |= keys

    def put(self, key: str, value: Any) -> None:
        """Stores a value without an event; computed keys stay computed."""
        if key not in self._computed:
            self._data[key] = _Entry(value, self._clock())

    def value_or_none(self, key: Any) -> Any:
        """Returns the value of a key, or None."""
        try:
            return self.get_data(key)
        except (ValueError, TypeError, ServiceError):
            return None

    def listen(self, name: str, callback: Callable[[Any], None]) -> None:
        """Has events of a name call a function of this process with their values."""
        self._events.add(name)
        self._listeners.append((name, callback))

    def stop_listening(self, callback: Callable[[Any], None]) -> None:
        """No longer calls a function."""
        self._listeners = [known for known in self._listeners if known[1] != callback]

    # NAOqi's methods.

    def get_data(self, key: str, _deprecated: int = 0) -> Any:
        """Returns the value of a key."""
        if key in self._computed:
            return self._computed[key]()
        if key not in self._data:
            raise ValueError(f"data not found: {key}")
        return self._data[key].value

    def get_data_on_change(self, key: str, _deprecated: int = 0) -> Any:
        """Returns the value of a key (long deprecated)."""
        return self.get_data(key)

    def get_list_data(self, keys: Any) -> list[Any]:
        """Returns the values of keys, None for a missing one."""
        if not isinstance(keys, list | tuple):
            raise ValueError("the keys must be a list")
        return [self.value_or_none(key) for key in keys]

    def get_timestamp(self, key: str) -> list[Any]:
        """Returns a key's value and time stamp, in seconds and microseconds."""
        value = self.get_data(key)
        time = self._data[key].time if key in self._data else self._clock()
        return [value, *split_time(time)]

    def get_type(self, key: str) -> str:
        """Returns the type of a key's value."""
        value = self.get_data(key)
        names = {bool: "Bool", int: "Int", float: "Float", str: "String", bytes: "Binary"}
        return names.get(type(value), "Array" if isinstance(value, list | tuple) else "Unknown")

    def get_data_list(self, text: str) -> list[str]:
        """Returns the keys that contain a text."""
        return [key for key in self.get_data_list_name() if text in key]

    def get_data_list_name(self) -> list[str]:
        """Returns all keys that have a value: programs read each that they find."""
        measured = {key for key in self._computed if self.value_or_none(key) is not None}
        return sorted(self._data.keys() | measured)

    def insert_data(self, key: str, value: Any) -> None:
        """Stores a value without an event; measurements overwrite theirs at once, as on a robot."""
        self.put(key, value)

    def insert_list_data(self, pairs: Any) -> None:
        """Stores values, given as [[key, value], ...]."""
        if not isinstance(pairs, list | tuple):
            raise ValueError("the list must hold [key, value]")
        for pair in pairs:
            if not isinstance(pair, list | tuple) or len(pair) != 2:
                raise ValueError("the list must hold [key, value]")
            self.insert_data(pair[0], pair[1])

    def remove_data(self, key: str) -> None:
        """Removes a key."""
        if self._data.pop(key, None) is None:
            raise ValueError(f"data not found: {key}")

    def declare_event(self, name: str, _extractor: str = "") -> None:
        """Declares an event."""
        self._events.add(name)

    def raise_event(self, name: str, value: Any) -> None:
        """Stores a value and notifies its subscribers."""
        self.put(name, value)
        self._events.add(name)
        past = self._history.setdefault(name, deque(maxlen=_HISTORY))
        past.append([value, *split_time(self._clock())])
        self._notify(name, value)

    def raise_micro_event(self, name: str, value: Any) -> None:
        """Stores a value and notifies its subscribers."""
        self.put(name, value)
        self._notify(name, value)

    def remove_event(self, name: str) -> None:
        """Removes an event."""
        self._events.discard(name)
        self._data.pop(name, None)

    def remove_micro_event(self, name: str) -> None:
        """Removes an event."""
        self.remove_event(name)

    def get_event_list(self) -> list[str]:
        """Returns the events that were declared, raised or subscribed to."""
        return sorted(self._events | self._subscribers.keys() | self._modules.keys())

    def get_micro_event_list(self) -> list[str]:
        """Returns no events: micro-events count as events."""
        return []

    def get_extractor_event(self, _extractor: str) -> list[str]:
        """Returns no events: no extractor is simulated."""
        return []

    def get_event_history(self, key: str) -> list[Any]:
        """Returns the last values of an event, each with its seconds and microseconds."""
        return list(self._history.get(key, ()))

    def get_subscribers(self, name: str) -> list[str]:
        """Returns the modules that an event calls."""
        return sorted(self._modules.get(name, ()))

    def subscriber(self, name: str) -> Service:
        """Returns an object whose signal `signal` is emitted with an event."""
        self._events.add(name)
        service = Service(description=f"subscriber of {name}")
        service.add_signal("signal", "(m)")
        listeners = self._subscribers.setdefault(name, [])

        def ended() -> None:
            if service in listeners:
                listeners.remove(service)

        service.on_terminated = ended
        listeners.append(service)
        return service

    def subscribe_to_event(self, name: str, module: str, *rest: str) -> None:
        """Subscribes `method(key, value, message)` of a client's registered module to an event.

        `rest` is the method alone, or a message and the method.
        """
        message, method = ("", rest[0]) if len(rest) == 1 else rest
        self._events.add(name)
        self._modules.setdefault(name, {})[module] = (method, message)

    def subscribe_to_micro_event(self, name: str, module: str, message: str, method: str) -> None:
        """As `subscribeToEvent`."""
        self.subscribe_to_event(name, module, message, method)

    def unsubscribe_to_event(self, name: str, module: str) -> None:
        """Ends a module's subscription."""
        if self._modules.get(name, {}).pop(module, None) is None:
            raise ValueError(f"{module} has not subscribed to {name}")

    def unsubscribe_to_micro_event(self, name: str, module: str) -> None:
        """Ends a module's subscription."""
        self.unsubscribe_to_event(name, module)

    def unregister_module_reference(self, module: str) -> None:
        """Ends all subscriptions of a module."""
        for modules in self._modules.values():
            modules.pop(module, None)

    def set_description(self, name: str, description: str) -> None:
        """Sets the description of a key."""
        self._descriptions[name] = description

    def get_description_list(self, keys: list[str]) -> list[Any]:
        """Returns keys with their descriptions."""
        return [[key, self._descriptions.get(key, "")] for key in keys]

    def _notify(self, name: str, value: Any) -> None:
        for service in list(self._subscribers.get(name, ())):
            service.emit("signal", value)
        finder = self._finder()
        for module, (method, message) in list(self._modules.get(name, {}).items()):
            target = finder.find(module) if finder is not None else None
            if target is None:
                self._modules[name].pop(module)
            else:
                call = asyncio.get_running_loop().create_task(
                    _call(target, method, name, value, message)
                )
                # The loop itself only holds weak references to tasks.
                self._pending.add(call)
                call.add_done_callback(self._pending.discard)
        for event, callback in self._listeners:
            if event == name:
                callback(value)


async def _call(
    target: Service | RemoteObject, method: str, name: str, value: Any, message: str
) -> None:
    """Calls a client's module; its answer or failure is ignored."""
    if isinstance(target, Service):
        return
    try:
        await target.call(method, name, value, message)
    except ServiceError:
        return
