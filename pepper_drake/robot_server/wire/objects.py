"""Objects on the wire: their meta-objects, and objects of clients."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol

from pepper_drake.naoqi.wire import Reader, Signature, encode, parse_signature
from pepper_drake.robot_server.wire.call_watch import TRACE, TRACE_UID
from pepper_drake.robot_server.wire.service import Service, ServiceError

METHOD = "(Issss[(ss)<MetaMethodParameter,name,description>]s)" + (
    "<MetaMethod,uid,returnSignature,name,parametersSignature,description,parameters,"
    "returnDescription>"
)
META_OBJECT = (
    f"({{I{METHOD}}}{{I(Iss)<MetaSignal,uid,name,signature>}}"
    "{I(Iss)<MetaProperty,uid,name,signature>}s)<MetaObject,methods,signals,properties,description>"
)
STATISTICS = (
    "{I(I(fff)<MinMaxSum,minValue,maxValue,cumulatedValue>"
    "(fff)<MinMaxSum,minValue,maxValue,cumulatedValue>"
    "(fff)<MinMaxSum,minValue,maxValue,cumulatedValue>)<MethodStatistics,count,wall,user,system>}"
)


@dataclass(frozen=True)
class Action:
    """A common action of all objects: uid, name, parameters, value."""

    uid: int
    name: str
    parameters: str
    returns: str


class Common:
    """The common actions of all objects, with libqi's names and numbers."""

    REGISTER_EVENT = Action(0, "registerEvent", "(IIL)", "L")
    UNREGISTER_EVENT = Action(1, "unregisterEvent", "(IIL)", "v")
    META_OBJECT = Action(2, "metaObject", "(I)", META_OBJECT)
    TERMINATE = Action(3, "terminate", "(I)", "v")
    PROPERTY = Action(5, "property", "(m)", "m")
    SET_PROPERTY = Action(6, "setProperty", "(mm)", "v")
    PROPERTIES = Action(7, "properties", "()", "[s]")
    REGISTER_WITH_SIGNATURE = Action(8, "registerEventWithSignature", "(IILs)", "L")
    IS_STATS_ENABLED = Action(80, "isStatsEnabled", "()", "b")
    ENABLE_STATS = Action(81, "enableStats", "(b)", "v")
    STATS = Action(82, "stats", "()", STATISTICS)
    CLEAR_STATS = Action(83, "clearStats", "()", "v")
    IS_TRACE_ENABLED = Action(84, "isTraceEnabled", "()", "b")
    ENABLE_TRACE = Action(85, "enableTrace", "(b)", "v")


COMMON_ACTIONS = {
    action.uid: action for action in vars(Common).values() if isinstance(action, Action)
}
"""The same by their uids."""


def meta_object(service: Service) -> tuple[Any, ...]:
    """Returns the meta-object of a service, of the signature `META_OBJECT`."""
    methods: dict[int, tuple[Any, ...]] = {
        a.uid: (a.uid, a.returns, a.name, a.parameters, "", [], "") for a in COMMON_ACTIONS.values()
    }
    for m in service.methods.values():
        methods[m.uid] = (m.uid, m.returns, m.name, m.parameters, m.description, [], "")
    signals = {s.uid: (s.uid, s.name, s.parameters) for s in service.signals.values()}
    signals[TRACE_UID] = (TRACE_UID, "traceObject", f"({TRACE})")
    properties = {p.uid: (p.uid, p.name, p.signature) for p in service.properties.values()}
    return methods, signals, properties, service.description


def write_meta_object(service: Service) -> bytes:
    """Returns the encoded meta-object of a service."""
    return encode(META_OBJECT, meta_object(service))


@dataclass(frozen=True)
class RemoteMethod:
    """A method of a client's object."""

    uid: int
    name: str
    parameters: str
    returns: str


class CallsBack(Protocol):
    """A connection for calls to its client's objects."""

    async def call_client(
        self, service: int, obj: int, action: int, parameters: str, arguments: Any, returns: str
    ) -> Any:
        """Calls and waits for the reply."""


class ClientObject:
    """An object in a client, called over the client's connection."""

    def __init__(
        self, connection: CallsBack, service: int, obj: int, methods: Iterable[RemoteMethod]
    ) -> None:
        """Stores the object's address.

        Args:
            connection: Of its client.
            service: Number of the service there.
            obj: Number of the object there.
            methods: Its methods.
        """
        self._connection = connection
        self._service, self._object = service, obj
        self._methods = tuple(methods)

    async def call(self, method: str, *arguments: Any) -> Any:
        """Calls a method there; see `RemoteObject`.

        The overload that takes most of the arguments gets as many as it takes: NAOqi's modules
        in Python may leave out an event's last arguments, or take all as `*arguments`.
        """
        taken = {
            m: _accepted_count(m.parameters, len(arguments))
            for m in self._methods
            if m.name == method
        }
        found = max(taken, key=lambda m: taken[m], default=None)
        if found is None or taken[found] < 0:
            raise ServiceError(f"the client's object has no {method} of {len(arguments)} arguments")
        return await self._connection.call_client(
            self._service,
            self._object,
            found.uid,
            found.parameters,
            arguments[: taken[found]],
            found.returns,
        )


def _accepted_count(parameters: str, given: int) -> int:
    """Returns how many of the given arguments a method accepts; -1 if it needs more."""
    parsed: Signature = parse_signature(parameters)
    if parsed.letter == "m":  # Any number, sent as a tuple in one dynamic value.
        return given
    return len(parsed.items) if len(parsed.items) <= given else -1


def remote_methods(meta: tuple[Any, ...]) -> list[RemoteMethod]:
    """Returns the methods in a decoded meta-object."""
    return [RemoteMethod(m[0], m[2], m[3], m[1]) for m in meta[0].values()]


def read_object(reader: Reader, connection: CallsBack) -> ClientObject:
    """Reads an object of a client: meta-object, service and object number."""
    meta = reader.read(META_OBJECT)
    service, obj = reader.read("I"), reader.read("I")
    return ClientObject(connection, service, obj, remote_methods(meta))
