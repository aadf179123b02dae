"""A client's connection: its handshake, calls, subscriptions and objects.

A client's errors end its own connection, and no other.
"""

import asyncio
import contextlib
import hmac
import itertools
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol

from pepper_drake.naoqi.wire import (
    HEADER,
    Message,
    MessageFlag,
    MessageType,
    Reader,
    Typed,
    WireError,
    decode,
    encode,
    fit,
    parse_signature,
    read_header,
)
from pepper_drake.robot_server.wire.call_watch import TRACE, TRACE_UID
from pepper_drake.robot_server.wire.objects import (
    COMMON_ACTIONS,
    META_OBJECT,
    ClientObject,
    Common,
    meta_object,
    read_object,
    remote_methods,
    write_meta_object,
)
from pepper_drake.robot_server.wire.service import (
    Caller,
    Method,
    Service,
    ServiceError,
    as_awaitable,
)

AUTHENTICATE = (0, 8)
"""Service and action of the handshake."""
_HANDSHAKE_SECONDS = 10.0
"""Timeout of a client's authentication [s]."""
_MESSAGE_SECONDS = 30.0
"""Timeout of an incomplete message [s]."""
_HANDSHAKE_BYTES = 64 * 1024
"""Largest message before the client has authenticated [bytes]."""
_WAITING_BYTES = 32 * 2**20
"""Back pressure limit: a client with more unread bytes is dropped; two of the largest images."""
_CALLS = 256
"""Most concurrent calls of a client; the next is read when one has ended."""
_OBJECTS = 1024
"""Most objects of a client."""
_FAILED, _DONE = 1, 3
"""Values of `__qi_auth_state`."""
_CAPABILITIES = {
    "ClientServerSocket": True,
    "MessageFlags": True,
    "MetaObjectCache": False,
    "ObjectPtrUID": False,
    "RelativeEndpointURI": False,
    "RemoteCancelableCalls": True,
}


@dataclass(frozen=True)
class Credentials:
    """The user and password that clients must give."""

    user: str
    password: str

    def accept(self, user: object, token: object) -> bool:
        """Returns whether they match, in constant time against timing attacks."""
        given = f"{user}\0{token}".encode(errors="replace")
        return hmac.compare_digest(given, f"{self.user}\0{self.password}".encode())


class Objects(Protocol):
    """Services by number, for connections."""

    def service(self, number: int) -> Service | None:
        """Returns the service of a number."""


@dataclass(frozen=True)
class _Subscription:
    service: int
    object: int
    signal: int
    signature: str


class Connection:
    """A client.

    Attributes:
        caller: Its identity for handlers.
    """

    def __init__(
        self,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        caller: Caller,
        objects: Objects,
        credentials: Credentials | None,
        log: Callable[[str], None],
    ) -> None:
        """Takes over a connection.

        Args:
            reader: From the client.
            writer: To the client.
            caller: Its number and address.
            objects: The services.
            credentials: Required of the client, or None.
            log: Takes a line for the user.
        """
        self.caller = caller
        self._reader, self._writer = reader, writer
        self._objects, self._credentials, self._log = objects, credentials, log
        self._authenticated = False
        self._temporary: dict[tuple[int, int], Service] = {}
        self._numbers = itertools.count(2)
        self._calls: dict[int, asyncio.Task[None]] = {}
        self._free = asyncio.Semaphore(_CALLS)
        self._subscriptions: dict[tuple[int, int, int], _Subscription] = {}
        self._waiting: dict[int, asyncio.Future[Message]] = {}
        self._ids = itertools.count(1)
        self._closed = False

    async def serve(self) -> None:
        """Serves the client until it disconnects or violates the protocol."""
        try:
            while True:
                message = await self._next_message()
                await self._handle(message)
        except WireError as error:
            self._log(f"{self.caller.address}: {error}; connection closed")
        except (asyncio.IncompleteReadError, ConnectionError, TimeoutError):
            pass
        finally:
            await self._close()

    def abort(self) -> None:
        """Ends the connection without waiting for unsent data."""
        self._writer.transport.abort()

    async def _next_message(self) -> Message:
        idle = None if self._authenticated else _HANDSHAKE_SECONDS
        async with asyncio.timeout(idle):
            first = await self._reader.readexactly(1)
        async with asyncio.timeout(_MESSAGE_SECONDS):
            header = first + await self._reader.readexactly(HEADER.size - 1)
            message, size = read_header(header)
            if not self._authenticated and size > _HANDSHAKE_BYTES:
                raise WireError(f"{size} bytes before the handshake")
            return replace(message, payload=await self._reader.readexactly(size))

    async def _handle(self, message: Message) -> None:
        kind = message.type
        if not self._authenticated:
            if kind == MessageType.CAPABILITY:
                return
            if kind == MessageType.CALL and (message.service, message.action) == AUTHENTICATE:
                self._handshake(message)
                return
            raise WireError("a message before the handshake")
        if kind in (MessageType.REPLY, MessageType.ERROR, MessageType.CANCELED):
            future = self._waiting.pop(message.id, None)
            if future is not None and not future.done():
                future.set_result(message)
        elif kind in (MessageType.CALL, MessageType.POST):
            await self._free.acquire()
            self._start(message)
        elif kind == MessageType.CANCEL:
            self._cancel(message)
        elif kind not in (MessageType.CAPABILITY, MessageType.EVENT):
            raise WireError(f"a message of the unknown type {kind}")

    def _cancel(self, message: Message) -> None:
        """Cancels the named call; as on a robot, a request without a name is ignored."""
        with contextlib.suppress(WireError):
            task = self._calls.get(decode("I", message.payload))
            if task is not None:
                task.cancel()

    def _handshake(self, message: Message) -> None:
        given = decode("{sm}", message.payload)
        user = given.get("auth_user", "")
        if self._credentials and not self._credentials.accept(user, given.get("auth_token", "")):
            self._answer(message, "{sm}", {"__qi_auth_state": Typed("I", _FAILED)})
            raise WireError("a wrong user or password")
        self._authenticated = True
        self.caller = replace(self.caller, user=str(user))
        state = {"__qi_auth_state": Typed("I", _DONE)}
        self._answer(message, "{sm}", _CAPABILITIES | state)

    def _start(self, message: Message) -> None:
        """Runs a call. Synchronous results are answered at once, in the order of the calls."""
        answers = message.type == MessageType.CALL
        try:
            result, signature = self._perform(message)
            waiting = as_awaitable(result)
        except ServiceError as error:
            self._free.release()
            if answers:
                self._send_error(message, str(error))
            return
        if waiting is None:
            self._free.release()
            if answers:
                self._reply(message, signature, result)
            return
        task = asyncio.ensure_future(self._finish(message, signature, waiting))
        self._calls[message.id] = task
        task.add_done_callback(lambda done: self._ended(message.id, done))

    def _ended(self, number: int, task: asyncio.Task[None]) -> None:
        self._free.release()
        if self._calls.get(number) is task:
            del self._calls[number]

    async def _finish(self, message: Message, signature: str, waiting: Any) -> None:
        answers = message.type == MessageType.CALL
        try:
            result = await waiting
            if answers:
                self._reply(message, signature, result)
        except asyncio.CancelledError:
            if answers:
                self._send(replace(message, type=MessageType.CANCELED, payload=b"", flags=0))
        except ServiceError as error:
            if answers:
                self._send_error(message, str(error))
        except Exception as error:
            self._log(f"{self.caller.address}: {type(error).__name__} in a call: {error}")
            if answers:
                self._send_error(message, "the call failed in the robot")

    def _perform(self, message: Message) -> tuple[Any, str]:
        """Returns the result of a call (possibly awaitable), and its signature."""
        service = self._find(message.service, message.object)
        if service is None:
            raise ServiceError(f"no object {message.service}.{message.object}")
        common = COMMON_ACTIONS.get(message.action)
        if common is not None:
            arguments = self._arguments(message, common.parameters)
            return self._common(message, service, common.uid, arguments), common.returns
        if message.action in service.properties:
            found = service.properties[message.action]
            return found.get(), found.signature
        method = service.methods.get(message.action)
        if method is None:
            raise ServiceError(f"{service.name or 'object'}: no method {message.action}")
        arguments = self._arguments(message, method.parameters)
        watch, call = service.watch, partial(self._call, service, method, arguments)
        if watch.counts or watch.traces:
            trace = partial(_emit_trace, service)
            return watch.run(call, method.uid, message.id, arguments, trace), method.returns
        return call(), method.returns

    def _call(self, service: Service, method: Method, arguments: tuple[Any, ...]) -> Any:
        if method.wants_caller:
            arguments = (self.caller, *arguments)
        try:
            return method.handler(*arguments)
        except ServiceError:
            raise
        except Exception as error:
            self._log(f"{service.name}.{method.name}: {type(error).__name__}: {error}")
            raise ServiceError(f"{service.name}::{method.name}: failed in the robot") from None

    def _arguments(self, message: Message, parameters: str) -> tuple[Any, ...]:
        """Returns the arguments of a call.

        A call may request a type of its value; since libqi's callers convert values themselves, the
        value is sent as the method declares it.
        """
        reader = Reader(message.payload, lambda at: read_object(at, self))
        dynamic = message.flags & MessageFlag.DYNAMIC_PAYLOAD
        declared = parse_signature(parameters)
        try:
            arguments: Any = reader.read("m" if dynamic else parameters)
            # A caller that cannot convert its arguments leaves that to us.
            arguments = fit(declared, arguments) if dynamic else arguments
        except WireError as error:
            raise ServiceError(f"the arguments do not fit {parameters}: {error}") from None
        if not isinstance(arguments, tuple) or len(arguments) != len(declared.items):
            raise ServiceError(f"the arguments do not fit {parameters}")
        return arguments

    def _common(
        self, message: Message, service: Service, action: int, arguments: tuple[Any, ...]
    ) -> Any:
        """Performs one of the common actions of all objects."""
        if action in (Common.REGISTER_EVENT.uid, Common.REGISTER_WITH_SIGNATURE.uid):
            _, signal, link, *wanted = arguments
            self._subscribe(message, service, signal, link, wanted[0] if wanted else "")
            return link
        if action == Common.UNREGISTER_EVENT.uid:
            self._unsubscribe(service, (message.service, message.object, arguments[2]))
        elif action == Common.META_OBJECT.uid:
            return meta_object(service)
        elif action == Common.TERMINATE.uid:
            self._terminate(message.service, message.object)
        elif action == Common.PROPERTY.uid:
            return self._property(service, arguments[0]).get()
        elif action == Common.SET_PROPERTY.uid:
            found = self._property(service, arguments[0])
            if found.set is None:
                raise ServiceError(f"{service.name}: {found.name} can be read only")
            found.set(arguments[1])
        elif action == Common.PROPERTIES.uid:
            return [p.name for p in service.properties.values()]
        elif action == Common.IS_STATS_ENABLED.uid:
            return service.watch.counts
        elif action == Common.ENABLE_STATS.uid:
            service.watch.counts = arguments[0]
        elif action == Common.STATS.uid:
            return service.watch.statistics()
        elif action == Common.CLEAR_STATS.uid:
            service.watch.clear()
        elif action == Common.IS_TRACE_ENABLED.uid:
            return service.watch.traces
        elif action == Common.ENABLE_TRACE.uid:
            service.watch.traces = arguments[0]
        return None

    def _property(self, service: Service, name: Any) -> Any:
        for number, found in service.properties.items():
            if name in (number, found.name):
                return found
        raise ServiceError(f"{service.name}: no property {name!r:.60}")

    def _find(self, service: int, obj: int) -> Service | None:
        if obj <= 1:
            return self._objects.service(service)
        return self._temporary.get((service, obj))

    def _subscribe(
        self, message: Message, service: Service, signal: int, link: int, wanted: str
    ) -> None:
        found = service.signals.get(signal)
        if found is None and signal != TRACE_UID:
            raise ServiceError(f"{service.name or 'object'}: no signal {signal}")
        parameters = f"({TRACE})" if found is None else found.parameters
        key = (message.service, message.object, link)
        if len(self._subscriptions) >= _OBJECTS:
            raise ServiceError("too many subscriptions")
        self._subscriptions[key] = _Subscription(
            message.service, message.object, signal, wanted or parameters
        )
        if self._emit not in service.emitters:
            service.emitters.append(self._emit)
        self._notify_subscribers(service, signal)

    def _unsubscribe(self, service: Service, key: tuple[int, int, int]) -> None:
        gone = self._subscriptions.pop(key, None)
        if gone is None:
            return
        left = [s for s in self._subscriptions.values() if (s.service, s.object) == key[:2]]
        if not left and self._emit in service.emitters:
            service.emitters.remove(self._emit)
        self._notify_subscribers(service, gone.signal)

    def _notify_subscribers(self, service: Service, signal: int) -> None:
        found = service.signals.get(signal)
        if found is not None and found.on_subscribers is not None:
            found.on_subscribers(len(service.emitters))

    def _emit(self, service: Service, signal: int, parameters: str, arguments: Any) -> None:
        """Sends an event to each subscription of this client."""
        for subscription in list(self._subscriptions.values()):
            if subscription.signal != signal:
                continue
            if self._find(subscription.service, subscription.object) is not service:
                continue
            event = Message(
                MessageType.EVENT,
                next(self._ids),
                subscription.service,
                subscription.object,
                signal,
            )
            try:
                payload = encode(subscription.signature, arguments, self._object_writer(event))
            except WireError:
                payload = encode("m", Typed(parameters, arguments), self._object_writer(event))
                event = replace(event, flags=MessageFlag.DYNAMIC_PAYLOAD)
            self._send(replace(event, payload=payload))

    def _object_writer(self, message: Message) -> Callable[[Any], bytes]:
        """Returns a function that registers a service as this client's object, and encodes it."""

        def write(value: Any) -> bytes:
            if not isinstance(value, Service):
                raise WireError(f"{type(value).__name__} is not an object")
            if len(self._temporary) >= _OBJECTS:
                raise WireError("the client holds too many objects")
            number = next(self._numbers)
            self._temporary[message.service, number] = value
            return write_meta_object(value) + encode("(II)", (message.service, number))

        return write

    def _reply(self, message: Message, signature: str, value: Any) -> None:
        try:
            self._answer(message, signature, value)
        except WireError as error:
            self._log(f"a value of action {message.action} cannot be sent: {error}")
            self._send_error(message, f"the value does not fit {signature}")

    def _answer(self, message: Message, signature: str, value: Any) -> None:
        """Replies with a value."""
        payload = encode(signature, value, self._object_writer(message))
        self._send(replace(message, type=MessageType.REPLY, payload=payload, flags=0))

    def _send_error(self, message: Message, text: str) -> None:
        self._send(
            replace(message, type=MessageType.ERROR, payload=encode("m", text[:2000]), flags=0)
        )

    def _send(self, message: Message) -> None:
        if self._closed:
            return
        if self._writer.transport.get_write_buffer_size() > _WAITING_BYTES:
            self._log(f"{self.caller.address}: does not read what it asked for; connection closed")
            self.abort()
            self._closed = True
            return
        self._writer.write(message.to_bytes())

    async def call_client(
        self, service: int, obj: int, action: int, parameters: str, arguments: Any, returns: str
    ) -> Any:
        """Calls an object of the client over its own connection.

        Raises:
            ServiceError: The client has left, or answered with an error.
        """
        if self._closed:
            raise ServiceError("the client has left")
        number = next(self._ids)
        call = Message(MessageType.CALL, number, service, obj, action)
        payload = encode(parameters, arguments, self._object_writer(call))
        future = asyncio.get_running_loop().create_future()
        self._waiting[number] = future
        self._send(replace(call, payload=payload))
        answer = await future
        if answer.type != MessageType.REPLY:
            text = decode("m", answer.payload) if answer.payload else "cancelled"
            raise ServiceError(str(text))
        if answer.flags & MessageFlag.DYNAMIC_PAYLOAD:
            return Reader(answer.payload, lambda at: read_object(at, self)).read("m")
        return Reader(answer.payload, lambda at: read_object(at, self)).read(returns)

    async def client_service(self, number: int) -> ClientObject:
        """Returns a service that this client registered."""
        meta = Common.META_OBJECT
        found = await self.call_client(number, 1, meta.uid, meta.parameters, (0,), META_OBJECT)
        return ClientObject(self, number, 1, remote_methods(found))

    def _terminate(self, service: int, obj: int) -> None:
        ended = self._temporary.pop((service, obj), None)
        if ended is not None and ended.on_terminated is not None:
            ended.on_terminated()

    async def _close(self) -> None:
        self._closed = True
        for key in list(self._subscriptions):
            service = self._find(*key[:2])
            if service is not None:
                self._unsubscribe(service, key)
        for task in list(self._calls.values()):
            task.cancel()
        for service_number, number in list(self._temporary):
            self._terminate(service_number, number)
        for future in self._waiting.values():
            if not future.done():
                future.set_exception(ServiceError("the client has left"))
        self._writer.close()
        with contextlib.suppress(ConnectionError, TimeoutError, OSError):
            async with asyncio.timeout(1.0):
                await self._writer.wait_closed()


def _emit_trace(service: Service, event: tuple[Any, ...]) -> None:
    for emitter in list(service.emitters):
        emitter(service, TRACE_UID, f"({TRACE})", (event,))
