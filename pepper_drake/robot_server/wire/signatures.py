"""Methods and signals of NAOqi's services as data, and the making of services from them.

`signatures.csv` holds names, types and uids. Those of ALMotion, ALMemory, ALRobotPosture and most
others were read from robots (NAOqi 2.1 and, where a service is newer, 2.8); the rest follow the
documentation of NAOqi 2.5 and are listed after these. `moveTo` returns true or false, as documented
for Pepper.
"""

import csv
import inspect
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from typing import Any, TypeVar

from pepper_drake.robot_server.wire.service import Service, ServiceError

_TABLE = "signatures.csv"
_SIGNAL = "signal"
_PROPERTY = "property"

F = TypeVar("F", bound=Callable[..., Any])


@dataclass(frozen=True)
class MethodSignature:
    """A method of a service.

    Attributes:
        uid: Its number.
        name: Its name.
        parameters: Signature of its arguments, a tuple.
        returns: Signature of its value.
    """

    uid: int
    name: str
    parameters: str
    returns: str


@dataclass(frozen=True)
class SignalSignature:
    """A signal of a service: its number, name and the tuple of its values."""

    uid: int
    name: str
    parameters: str


@dataclass(frozen=True)
class PropertySignature:
    """A property of a service: its number, name and the signature of its value."""

    uid: int
    name: str
    value: str


@dataclass(frozen=True)
class ServiceSignature:
    """A service: its name, methods, signals and properties."""

    name: str
    methods: tuple[MethodSignature, ...]
    signals: tuple[SignalSignature, ...]
    properties: tuple[PropertySignature, ...]


@lru_cache(maxsize=1)
def service_signatures() -> dict[str, ServiceSignature]:
    """Returns the signatures of all services by name."""
    methods: dict[str, list[MethodSignature]] = {}
    signals: dict[str, list[SignalSignature]] = {}
    properties: dict[str, list[PropertySignature]] = {}
    text = resources.files("pepper_drake.robot_server.wire").joinpath(_TABLE).read_text("utf-8")
    for row in csv.DictReader(text.splitlines()):
        service, uid, name = row["service"], int(row["uid"]), row["name"]
        methods.setdefault(service, [])
        if row["returns"] == _SIGNAL:
            signals.setdefault(service, []).append(SignalSignature(uid, name, row["parameters"]))
        elif row["returns"] == _PROPERTY:
            found = PropertySignature(uid, name, row["parameters"])
            properties.setdefault(service, []).append(found)
        else:
            methods[service].append(MethodSignature(uid, name, row["parameters"], row["returns"]))
    return {
        name: ServiceSignature(
            name,
            tuple(methods[name]),
            tuple(signals.get(name, ())),
            tuple(properties.get(name, ())),
        )
        for name in methods
    }


def with_caller(handler: F) -> F:
    """Marks a method whose first argument is the `Caller`."""
    handler.wants_caller = True  # type: ignore[attr-defined]
    return handler


def python_name(name: str) -> str:
    """Returns the Python name of a NAOqi method: get_horizontal_fov for getHorizontalFOV."""
    parts = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name.lstrip("_"))
    return parts.lower()


def make_service(
    name: str, implementation: object, *, on_unserved: Callable[[str], None] | None = None
) -> Service:
    """Makes a service with the robot's table.

    A method is served by the implementation's method of that name in Python's style, which also
    serves its overloads. A missing one answers with the error "NAME: not simulated". A ValueError
    of the implementation becomes an error reply that begins with the method's name.

    Args:
        name: A service of the table.
        implementation: Has the methods.
        on_unserved: Called with a method's full name when it is called but not simulated.

    Returns:
        The service.
    """
    signature = service_signatures()[name]
    service = Service(name)
    for method in signature.methods:
        handler = getattr(implementation, python_name(method.name), None)
        wants_caller = getattr(handler, "wants_caller", False)
        if handler is None:
            handler = _refusal(f"{name}::{method.name}", on_unserved)
        service.add_method(
            method.name,
            method.parameters,
            method.returns,
            _with_errors(handler, f"{name}::{method.name}", method.returns == "v"),
            uid=method.uid,
            wants_caller=wants_caller,
        )
    for known in signature.properties:
        get = getattr(implementation, python_name(known.name), None)
        full_name = f"{name}::{known.name}"
        reading = _with_errors(get or _refusal(full_name, on_unserved), full_name, False)
        service.add_property(known.name, known.value, reading, uid=known.uid)
    for signal in signature.signals:
        if signal.uid in service.signals:
            continue  # The signal of a property.
        service.add_signal(signal.name, signal.parameters, uid=signal.uid)
    return service


def _with_errors(handler: Callable[..., Any], name: str, void: bool) -> Callable[..., Any]:
    if inspect.iscoroutinefunction(handler):

        async def answer_later(*arguments: Any) -> Any:
            try:
                value = await handler(*arguments)
            except ValueError as error:
                raise ServiceError(f"{name}: {error}") from error
            return None if void else value

        return answer_later

    def answer(*arguments: Any) -> Any:
        try:
            value = handler(*arguments)
        except ValueError as error:
            raise ServiceError(f"{name}: {error}") from error
        return None if void else value

    return answer


def _refusal(name: str, on_unserved: Callable[[str], None] | None) -> Callable[..., None]:
    def refuse(*_: Any) -> None:
        if on_unserved is not None:
            on_unserved(name)
        raise ServiceError(f"{name}: not simulated")

    return refuse
