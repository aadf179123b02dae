"""LogManager: clients receive the served robot's log, and write to it."""

import itertools
import time
from collections.abc import Callable
from typing import Any

from pepper_drake.robot_server.services.waiting import Module
from pepper_drake.robot_server.wire.service import Service

_LEVEL = "(i)<LogLevel,level>"
_MESSAGE = (
    f"(s{_LEVEL}sssI(L)<TimePoint,ns>(L)<TimePoint,ns>)"
    "<LogMessage,source,level,category,location,message,id,date,systemDate>"
)
_INFO = 4
"""Level of the served robot's messages; 1 is fatal, 6 debug."""


class LogManager(Module):
    """LogManager."""

    def __init__(self, log: Callable[[str], None]) -> None:
        """Makes the service without listeners.

        Args:
            log: Takes a line that a client logs.
        """
        super().__init__("LogManager")
        self._log = log
        self._numbers = itertools.count(1)
        self._providers = itertools.count(1)
        self._listeners: list[tuple[Service, list[int]]] = []

    def tell(self, line: str, level: int = _INFO, category: str = "pepper_drake") -> None:
        """Sends a line to the listeners; only to be called on the server's event loop."""
        if not self._listeners:
            return
        now = (time.time_ns(),)
        message = ("", (level,), category, "served:0", line, next(self._numbers), now, now)
        for listener, (least,) in list(self._listeners):
            if level <= least:
                listener.emit("onLogMessage", message)
                listener.emit("onLogMessages", [message])
                listener.emit("onLogMessagesWithBacklog", [message])

    def log(self, messages: list[tuple[Any, ...]]) -> None:
        """Logs messages of a client."""
        for message in messages:
            self._log(f"{message[2]}: {message[4]}")

    def create_listener(self) -> Service:
        """Returns a listener, which is removed when the client releases it."""
        level = [_INFO]
        listener = Service(description="listener to the log")

        def set_level(value: tuple[int]) -> None:
            level[0] = value[0]

        listener.add_method("setLevel", f"({_LEVEL})", "v", set_level)
        listener.add_method("addFilter", f"(s{_LEVEL})", "v", lambda *_: None)
        listener.add_method("clearFilters", "()", "v", lambda: None)
        listener.add_signal("onLogMessage", f"({_MESSAGE})")
        listener.add_signal("onLogMessages", f"([{_MESSAGE}])")
        listener.add_signal("onLogMessagesWithBacklog", f"([{_MESSAGE}])")
        listener.add_property("logLevel", _LEVEL, lambda: (level[0],), set_level)
        entry = (listener, level)
        self._listeners.append(entry)
        listener.on_terminated = lambda: self._listeners.remove(entry)
        return listener

    get_listener = create_listener

    def add_provider(self, _provider: Any) -> int:
        """Returns a number for a provider of messages; it calls `log`."""
        return next(self._providers)

    def remove_provider(self, _number: int) -> None:
        """Has no effect."""
