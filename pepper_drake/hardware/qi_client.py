"""A NAOqi client with our own protocol code: without libqi, it runs on any Python and processor."""

import asyncio
import contextlib
import itertools
import ssl
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from pepper_drake.errors import InputError
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.naoqi.wire import (
    HEADER,
    Message,
    MessageFlag,
    MessageType,
    Reader,
    Signature,
    WireError,
    encode,
    parse_signature,
    read_header,
)
from pepper_drake.robot_server.wire.objects import META_OBJECT, Common, RemoteMethod, remote_methods

PORTS = {"tcp": 9559, "tcps": 9503}
"""NAOqi's port by scheme: plain, and encrypted (NAOqi 2.9)."""
_CONNECT_SECONDS = 5.0
_DIRECTORY = 1
_MAIN = 1
_DONE = 3
"""Value of `__qi_auth_state` after a successful authentication."""


@dataclass(frozen=True)
class RobotAddress:
    """An address such as `tcp://192.168.1.10:9559`.

    Attributes:
        scheme: "tcp", or "tcps" for an encrypted connection.
        host: Name or number of the host.
        port: Port.
    """

    scheme: str
    host: str
    port: int

    @classmethod
    def parse(cls, text: str) -> "RobotAddress":
        """Reads an address; the default scheme is tcp, the default port NAOqi's.

        Raises:
            InputError: It is not an address.

        Example:
            >>> RobotAddress.parse("pepper.local")
            RobotAddress(scheme='tcp', host='pepper.local', port=9559)
        """
        try:
            parts = urlsplit(text if "://" in text else f"tcp://{text}")
            port = parts.port
        except ValueError:
            parts, port = urlsplit(""), None
        if parts.scheme not in PORTS or not parts.hostname or parts.path not in ("", "/"):
            raise InputError(
                f'"{text}" is not a robot\'s address; give one as tcp://192.168.1.10:9559'
            )
        return cls(parts.scheme, parts.hostname, port or PORTS[parts.scheme])

    def __str__(self) -> str:
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"{self.scheme}://{host}:{self.port}"


class CallError(LinkFault):
    """The robot answered a call with an error."""

    def __init__(self, call: str, text: str) -> None:
        """Names the call.

        Args:
            call: Service and method.
            text: The robot's error message.
        """
        super().__init__("call_failed", f"{call}: {text}")


class RemoteObject:
    """An object of the robot: a service, or one that a method returned."""

    def __init__(
        self, connection: "QiConnection", name: str, service: int, obj: int, meta: tuple[Any, ...]
    ) -> None:
        """Stores the object's address and meta-object.

        Args:
            connection: For its calls.
            name: Name for messages.
            service: Number of its service.
            obj: Number of the object.
            meta: Its meta-object.
        """
        self._connection, self._name = connection, name
        self._service, self._object = service, obj
        self._methods = remote_methods(meta)
        self._signals = {signal[1]: (signal[0], signal[2]) for signal in meta[1].values()}

    async def call(self, method: str, *arguments: Any) -> Any:
        """Calls a method and returns its value.

        Raises:
            LinkFault: The method is missing, the robot answered with an error, or is gone.
        """
        found, payload = self._chosen(method, arguments)
        return await self._connection.request(
            f"{self._name}.{method}", self._service, self._object, found.uid, payload, found.returns
        )

    async def subscribe(self, signal: str, callback: Callable[..., None]) -> None:
        """Subscribes a callback to a signal; it is called with the signal's values."""
        if signal not in self._signals:
            raise LinkFault("service_missing", f"{self._name} has no signal {signal}")
        uid, parameters = self._signals[signal]
        await self._connection.listen(self._service, self._object, uid, parameters, callback)

    def _chosen(self, method: str, arguments: tuple[Any, ...]) -> tuple[RemoteMethod, bytes]:
        """Returns the overload that fits the arguments best, and the encoded arguments."""
        scored = sorted(
            (
                (_fit(parse_signature(found.parameters), arguments), found)
                for found in self._methods
                if found.name == method
            ),
            key=lambda pair: -pair[0],
        )
        for fit, found in scored:
            if fit >= 0:
                with contextlib.suppress(WireError):
                    return found, encode(found.parameters, arguments)
        text = ", ".join(found.parameters for _, found in scored) or "nothing of that name"
        raise LinkFault("service_missing", f"{self._name}.{method} takes {text}")


class QiConnection:
    """One connection to one process of the robot."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """Takes over an open connection; `open` makes one.

        Args:
            reader: From the robot.
            writer: To the robot.
        """
        self._reader, self._writer = reader, writer
        self._ids = itertools.count(1)
        self._links = itertools.count(1)
        self._waiting: dict[int, tuple[str, str, asyncio.Future[Any]]] = {}
        self._listeners: dict[tuple[int, int, int], list[tuple[str, Callable[..., None]]]] = {}
        self._task: asyncio.Task[None] | None = None
        self.lost: asyncio.Future[None] = asyncio.get_running_loop().create_future()

    @classmethod
    async def open(
        cls, address: RobotAddress, user: str = "", password: str = ""
    ) -> "QiConnection":
        """Connects and authenticates.

        Raises:
            LinkFault: No robot answers there, or it refuses the connection.
        """
        context = None
        if address.scheme == "tcps":
            # A robot's certificate is self-signed: there is nothing to verify.
            context = ssl.create_default_context()
            context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
        try:
            async with asyncio.timeout(_CONNECT_SECONDS):
                streams = await asyncio.open_connection(address.host, address.port, ssl=context)
        except ssl.SSLError as error:
            raise LinkFault("robot_refused", f"{address}: {error.reason}") from None
        except (OSError, TimeoutError) as error:
            why = "no answer" if isinstance(error, TimeoutError) else error.strerror or str(error)
            raise LinkFault("robot_unreachable", f"{address}: {why}") from None
        connection = cls(*streams)
        connection._task = asyncio.ensure_future(connection._receive())
        capabilities: dict[str, Any] = {"ClientServerSocket": True, "MessageFlags": True}
        if user or password:
            capabilities |= {"auth_user": user, "auth_token": password}
        try:
            async with asyncio.timeout(_CONNECT_SECONDS):
                given = await connection.request(
                    "authenticate", 0, 0, 8, encode("{sm}", capabilities), "{sm}"
                )
        except (LinkFault, TimeoutError):
            await connection.close()
            raise LinkFault("robot_refused", str(address)) from None
        if given.get("__qi_auth_state", _DONE) != _DONE:
            await connection.close()
            raise LinkFault("robot_refused", str(address))
        return connection

    async def object(self, name: str, service: int, obj: int = _MAIN) -> RemoteObject:
        """Returns an object by its numbers."""
        meta = await self.request(
            f"{name}.metaObject",
            service,
            obj,
            Common.META_OBJECT.uid,
            encode("(I)", (0,)),
            META_OBJECT,
        )
        return RemoteObject(self, name, service, obj, meta)

    async def request(
        self, call: str, service: int, obj: int, action: int, payload: bytes, returns: str
    ) -> Any:
        """Sends a call and waits for its answer.

        Raises:
            LinkFault: The robot answered with an error, or the connection is lost.
        """
        if self.lost.done():
            raise LinkFault("link_lost", f"at {call}")
        number = next(self._ids)
        future: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
        self._waiting[number] = (call, returns, future)
        message = Message(MessageType.CALL, number, service, obj, action, payload)
        try:
            self._writer.write(message.to_bytes())
            return await future
        except asyncio.CancelledError:
            self._cancel(number, service, obj, action)
            raise
        finally:
            self._waiting.pop(number, None)

    async def listen(
        self,
        service: int,
        obj: int,
        signal: int,
        parameters: str,
        callback: Callable[..., None],
    ) -> None:
        """Subscribes to a signal; see `RemoteObject.subscribe`."""
        self._listeners.setdefault((service, obj, signal), []).append((parameters, callback))
        action = Common.REGISTER_EVENT
        arguments = encode(action.parameters, (service, signal, next(self._links)))
        await self.request("registerEvent", service, obj, action.uid, arguments, action.returns)

    async def close(self) -> None:
        """Ends the connection."""
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task
        self._writer.close()
        with contextlib.suppress(OSError, TimeoutError):
            async with asyncio.timeout(1.0):
                await self._writer.wait_closed()

    def _cancel(self, number: int, service: int, obj: int, action: int) -> None:
        """Cancels a call in the robot."""
        if not self.lost.done():
            payload = encode("I", number)
            cancel = Message(MessageType.CANCEL, next(self._ids), service, obj, action, payload)
            self._writer.write(cancel.to_bytes())

    async def _receive(self) -> None:
        try:
            while True:
                message, size = read_header(await self._reader.readexactly(HEADER.size))
                self._handle(message, await self._reader.readexactly(size))
        except (asyncio.IncompleteReadError, OSError, WireError):
            pass
        finally:
            if not self.lost.done():
                self.lost.set_result(None)
            for call, _, future in list(self._waiting.values()):
                if not future.done():
                    future.set_exception(LinkFault("link_lost", f"during {call}"))

    def _handle(self, message: Message, payload: bytes) -> None:
        reader = Reader(payload, self._read_object)
        if message.type == MessageType.EVENT:
            key = (message.service, message.object, message.action)
            for parameters, callback in self._listeners.get(key, ()):
                dynamic = message.flags & MessageFlag.DYNAMIC_PAYLOAD
                callback(*Reader(payload, self._read_object).read("m" if dynamic else parameters))
            return
        call, returns, future = self._waiting.get(message.id, ("", "", None))
        if future is None or future.done():
            return
        if message.type == MessageType.REPLY:
            dynamic = message.flags & MessageFlag.DYNAMIC_PAYLOAD
            try:
                future.set_result(reader.read("m" if dynamic else returns))
            except WireError as error:
                future.set_exception(CallError(call, f"an answer that cannot be read, {error}"))
        elif message.type == MessageType.ERROR:
            future.set_exception(CallError(call, str(reader.read("m"))))
        elif message.type == MessageType.CANCELED:
            future.set_exception(CallError(call, "it was cancelled"))

    def _read_object(self, reader: Reader) -> RemoteObject:
        meta = reader.read(META_OBJECT)
        return RemoteObject(self, "object", reader.read("I"), reader.read("I"), meta)


class QiSession:
    """A session with a robot: its services by name, in whichever of its processes."""

    def __init__(self, address: RobotAddress, user: str = "", password: str = "") -> None:
        """Keeps the address; `connect` connects.

        Args:
            address: Of the robot's service directory.
            user: Name to authenticate with, if the robot demands one.
            password: Of the user.
        """
        self._address, self._user, self._password = address, user, password
        self._connections: dict[RobotAddress, QiConnection] = {}
        self._directory: RemoteObject | None = None
        self._services: dict[str, RemoteObject] = {}

    async def connect(self) -> None:
        """Connects to the directory.

        Raises:
            LinkFault: No robot answers there, or it refuses the connection.
        """
        connection = await self._connection(self._address)
        self._directory = await connection.object("ServiceDirectory", _DIRECTORY)

    async def service(self, name: str) -> RemoteObject:
        """Returns a service.

        Raises:
            LinkFault: The robot has no such service, or it cannot be reached.
        """
        if name not in self._services:
            assert self._directory is not None, "connect first"
            try:
                info = await self._directory.call("service", name)
            except CallError:
                raise LinkFault("service_missing", name) from None
            for address in self._reachable(info[4]):
                with contextlib.suppress(LinkFault):
                    connection = await self._connection(address)
                    self._services[name] = await connection.object(name, info[1])
                    break
            else:
                raise LinkFault("robot_unreachable", f"{name} at {', '.join(info[4])}")
        return self._services[name]

    @property
    def is_lost(self) -> bool:
        """True if one of the connections has ended."""
        return any(connection.lost.done() for connection in self._connections.values())

    async def close(self) -> None:
        """Ends all connections."""
        for connection in self._connections.values():
            await connection.close()
        self._connections.clear()
        self._services.clear()

    async def _connection(self, address: RobotAddress) -> QiConnection:
        if address not in self._connections:
            self._connections[address] = await QiConnection.open(
                address, self._user, self._password
            )
        return self._connections[address]

    def _reachable(self, endpoints: list[str]) -> list[RobotAddress]:
        """Returns a service's addresses, the likeliest first.

        The robot lists addresses of its own network. Behind a tunnel or in a container only the
        host of our address reaches it, so its ports are tried there, too.
        """
        addresses = []
        for endpoint in endpoints:
            with contextlib.suppress(InputError):
                addresses.append(RobotAddress.parse(endpoint))
        wanted = [a for a in addresses if a.scheme == self._address.scheme]
        here = [RobotAddress(a.scheme, self._address.host, a.port) for a in wanted]
        return list(dict.fromkeys([*here, *wanted]))


def _fit(signature: Signature, value: Any) -> int:
    """Returns a score of how well a value fits a signature, negative if not at all."""
    letter, items = signature.letter, signature.items
    if letter == "m":
        return 1
    if letter == "b":
        return 3 if isinstance(value, bool) else -1
    if letter in "cCwWiIlL":
        return 3 if isinstance(value, int) and not isinstance(value, bool) else -1
    if letter in "fd":
        if isinstance(value, bool) or not isinstance(value, int | float):
            return -1
        return 3 if isinstance(value, float) else 2
    if letter == "s":
        return 3 if isinstance(value, str) else -1
    if letter == "[":
        if not isinstance(value, list):
            return -1
        return min((_fit(items[0], item) for item in value), default=2)
    if letter == "(":
        if not isinstance(value, tuple) or len(value) != len(items):
            return -1
        fits = [_fit(item, part) for item, part in zip(items, value, strict=True)]
        return -1 if min(fits, default=0) < 0 else sum(fits)
    return 2
