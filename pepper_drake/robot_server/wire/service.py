"""NAOqi's kind of services: methods, signals and properties with their signatures and uids.

A service is a table of plain Python callables. Nothing here depends on the network: the server
reads the table, calls the handlers on its asyncio loop and forwards emitted signals.

Values on both sides of a handler are plain Python, by the letter of the signature:

=============  ==========================================================================
`v`            `None`
`b`            `bool`
`c C w W i I l L`  `int` (8, 16, 32, 64 bits; capital: unsigned)
`f d`          `float` (32, 64 bits)
`s`            `str`
`r`            `bytes` (also bytearray, memoryview or a contiguous array when sent)
`[x]`          `list`
`{xy}`         `dict`
`(xyz)`        `tuple`
`m`            any of these; a received one comes without its wrapping
`o`            sent: a `Service`; received: a `RemoteObject`
=============  ==========================================================================

In a dynamic value `m`, an int is sent as `i` (`l` where it needs 64 bits), a float as `f`, as
NAOqi does, a list as `[m]`, a tuple as `(mm..)`, a dict as `{sm}` or `{mm}`, bytes as `r` and
`None` as `v`. `pepper_drake.naoqi.wire.Typed` sends another type.
"""

import asyncio
import concurrent.futures
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, Protocol

from pepper_drake.robot_server.wire.call_watch import CallWatch

FIRST_UID = 100
"""Lower ones are the common actions of all objects."""


class ServiceError(Exception):
    """An error reply: its text goes only to the caller.

    By convention it begins with the service's name, as in `ALMotion::setAngles: ...`.
    """


@dataclass(frozen=True)
class Caller:
    """The calling client.

    Attributes:
        client: Number of its connection, never reused.
        address: Its address, for the log.
        user: Authenticated user name, or "".
    """

    client: int
    address: str = ""
    user: str = ""


class RemoteObject(Protocol):
    """An object in a client: an argument of type `o`, or a service it registered."""

    async def call(self, method: str, *arguments: Any) -> Any:
        """Calls a method there and waits for its reply.

        Raises:
            ServiceError: The client has disconnected, has no such method, or replied with an error.
        """


class ServiceFinder(Protocol):
    """The directory for services; `ALMemory.subscribeToEvent` uses it for callbacks."""

    def find(self, name: str) -> "Service | RemoteObject | None":
        """Returns a service by name, ours or one that a client registered."""


Handler = Callable[..., Any]
"""Called with the arguments (after the `Caller` if the method wants it) on the server's loop.

It returns the value, or an awaitable of it: a coroutine, an asyncio or a concurrent future. A
plain handler must return within a millisecond, since all clients wait for it. A coroutine runs as a
task concurrently with other calls; when the client cancels the call, or disconnects, the task is
cancelled: `asyncio.CancelledError` is raised at its `await`, for cleanup and to be re-raised.
"""


@dataclass(frozen=True)
class Method:
    """A method, one of possibly several with its name (overloads).

    Attributes:
        uid: Its number.
        name: Name without signature.
        parameters: Signature of the arguments, a tuple such as `(mmf)`.
        returns: Signature of the value, such as `[f]`.
        handler: Its implementation.
        wants_caller: Whether the handler's first argument is the `Caller`.
        description: Text for people.
    """

    uid: int
    name: str
    parameters: str
    returns: str
    handler: Handler
    wants_caller: bool = False
    description: str = ""


@dataclass
class Signal:
    """A signal that clients may subscribe to.

    Attributes:
        uid: Number of the signal's event.
        name: Its name.
        parameters: Signature of its values, a tuple such as `(m)`.
        on_subscribers: Called with the number of subscribers whenever it changes.
    """

    uid: int
    name: str
    parameters: str
    on_subscribers: Callable[[int], None] | None = None


@dataclass
class Property:
    """A property: a value, with a signal of its changes of the same name and uid.

    Attributes:
        uid: Number of the property and of its signal.
        name: Its name.
        signature: Signature of the value, such as `f`.
        get: Returns the value.
        set: Takes a new value, or raises `ServiceError`; `None` makes it read-only.
    """

    uid: int
    name: str
    signature: str
    get: Callable[[], Any]
    set: Callable[[Any], None] | None = None


Emitter = Callable[["Service", int, str, tuple[Any, ...]], None]


@dataclass
class Service:
    """An object with methods, signals and properties, and a name if it is a service.

    A handler may return a nameless `Service` for the signature `o`: the client gets its own object,
    which ends when the client terminates it or disconnects.

    Attributes:
        name: Name in the directory, or "" for an object that a method returns.
        description: Text for people.
        on_client_left: Called with the `Caller` when a client's connection has ended, for any
            reason. Tasks that it started end here.
        on_terminated: Called when an object returned by a method has ended.
    """

    name: str = ""
    description: str = ""
    on_client_left: Callable[[Caller], None] | None = None
    on_terminated: Callable[[], None] | None = None
    methods: dict[int, Method] = field(default_factory=dict)
    signals: dict[int, Signal] = field(default_factory=dict)
    properties: dict[int, Property] = field(default_factory=dict)
    emitters: list[Emitter] = field(default_factory=list, repr=False)
    """Receivers of signals: the server adds itself."""
    watch: CallWatch = field(default_factory=CallWatch, repr=False)
    """Statistics and traces of its calls."""

    def add_method(
        self,
        name: str,
        parameters: str,
        returns: str,
        handler: Handler,
        *,
        uid: int | None = None,
        wants_caller: bool = False,
        description: str = "",
    ) -> Method:
        """Adds a method; another with the same name and other parameters is an overload.

        Args:
            name: Name without signature.
            parameters: Signature of the arguments, a tuple such as `(mmf)`.
            returns: Signature of the value.
            handler: Its implementation.
            uid: Its number on the robot; the next free one if left out.
            wants_caller: Whether the handler's first argument is the `Caller`.
            description: Text for people.

        Raises:
            ValueError: The uid is taken, or the name with these parameters.
        """
        if not (parameters.startswith("(") and parameters.endswith(")")):
            raise ValueError(f"{self.name}.{name}: parameters are a tuple, not {parameters!r}")
        if any(m.name == name and m.parameters == parameters for m in self.methods.values()):
            raise ValueError(f"{self.name}.{name}::{parameters} is there twice")
        number = self._new_uid(uid, name)
        method = Method(number, name, parameters, returns, handler, wants_caller, description)
        self.methods[number] = method
        return method

    def add_signal(
        self,
        name: str,
        parameters: str,
        *,
        uid: int | None = None,
        on_subscribers: Callable[[int], None] | None = None,
    ) -> Signal:
        """Adds a signal that carries `parameters`, a tuple such as `(m)`."""
        if not (parameters.startswith("(") and parameters.endswith(")")):
            raise ValueError(f"{self.name}.{name}: parameters are a tuple, not {parameters!r}")
        signal = Signal(self._new_uid(uid, name), name, parameters, on_subscribers)
        self.signals[signal.uid] = signal
        return signal

    def add_property(
        self,
        name: str,
        signature: str,
        get: Callable[[], Any],
        set: Callable[[Any], None] | None = None,
        *,
        uid: int | None = None,
    ) -> Property:
        """Adds a property; `emit(name, value)` notifies subscribers of a change."""
        number = self._new_uid(uid, name)
        self.properties[number] = Property(number, name, signature, get, set)
        self.signals[number] = Signal(number, name, f"({signature})")
        return self.properties[number]

    def emit(self, signal: str, *arguments: Any) -> None:
        """Sends a signal to its subscribers. Only to be called on the server's event loop.

        Raises:
            KeyError: There is no such signal.
        """
        found = next((s for s in self.signals.values() if s.name == signal), None)
        if found is None:
            raise KeyError(f"{self.name or 'object'} has no signal {signal}")
        for emitter in list(self.emitters):
            emitter(self, found.uid, found.parameters, arguments)

    def overloads(self, name: str) -> Iterator[Method]:
        """Yields the methods of a name, in the order of their uids."""
        return (self.methods[uid] for uid in sorted(self.methods) if self.methods[uid].name == name)

    def _new_uid(self, uid: int | None, name: str) -> int:
        taken = self.methods.keys() | self.signals.keys() | self.properties.keys()
        if uid is None:
            return max(taken | {FIRST_UID - 1}) + 1
        if uid in taken:
            raise ValueError(f"{self.name}.{name}: uid {uid} is taken")
        return uid


def as_awaitable(value: Any) -> Awaitable[Any] | None:
    """Returns a handler's result as an awaitable, or `None` if it is a plain value."""
    if isinstance(value, concurrent.futures.Future):
        return asyncio.wrap_future(value)
    return value if isinstance(value, Awaitable) else None
