"""The robot's services, over libqi or our own protocol code, with one interface."""

import asyncio
import contextlib
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any, Protocol

from pepper_drake.errors import InputError
from pepper_drake.hardware.link_fault import LinkFault
from pepper_drake.hardware.qi_client import CallError, QiSession, RobotAddress

LINKS = ("wire", "libqi")
"""Implementations: our own protocol code, or the maker's library."""


@dataclass(frozen=True)
class RobotAccess:
    """Address and credentials of a robot.

    Attributes:
        address: Such as `tcp://192.168.1.10:9559`.
        user: Name to authenticate with; NAOqi 2.9 demands one.
        password: Of the user.
        link: One of `LINKS`.
    """

    address: str
    user: str = ""
    password: str = ""
    link: str = "wire"


class Transport(Protocol):
    """Calls to a robot, from one asyncio loop."""

    async def connect(self) -> None:
        """Connects; LinkFault if it cannot."""

    async def call(self, service: str, method: str, *arguments: Any) -> Any:
        """Calls a method; LinkFault if it fails."""

    async def on_event(self, event: str, callback: Callable[[Any], None]) -> None:
        """Subscribes a callback to an event of ALMemory; it is called with the event's value."""

    @property
    def is_lost(self) -> bool:
        """True if the connection has ended."""

    async def close(self) -> None:
        """Ends the connection."""


class WireTransport:
    """A robot over our own protocol code."""

    def __init__(self, access: RobotAccess) -> None:
        """Stores the address.

        Args:
            access: Address and credentials of the robot.

        Raises:
            InputError: The address is malformed.
        """
        address = RobotAddress.parse(access.address)
        self._session = QiSession(address, access.user, access.password)
        self._subscribers: list[Any] = []

    async def connect(self) -> None:
        """Connects; see `Transport`."""
        await self._session.connect()

    async def call(self, service: str, method: str, *arguments: Any) -> Any:
        """Calls a method; see `Transport`."""
        return await (await self._session.service(service)).call(method, *arguments)

    async def on_event(self, event: str, callback: Callable[[Any], None]) -> None:
        """Subscribes to an event; see `Transport`."""
        subscriber = await self.call("ALMemory", "subscriber", event)
        self._subscribers.append(subscriber)
        await subscriber.subscribe("signal", callback)

    @property
    def is_lost(self) -> bool:
        """True if the connection has ended."""
        return self._session.is_lost

    async def close(self) -> None:
        """Ends the connection."""
        await self._session.close()


class LibqiTransport:
    """A robot over libqi. One per process: libqi has one application in each."""

    def __init__(self, access: RobotAccess) -> None:
        """Loads libqi.

        Args:
            access: Address and credentials of the robot.

        Raises:
            InputError: libqi is not installed, or the address is malformed.
        """
        RobotAddress.parse(access.address)
        if find_spec("qi") is None:
            raise InputError(
                'libqi is not installed: pip install "pepper-drake[naoqi]" where there is a wheel '
                "(Python 3.7 to 3.12 on x86-64 Linux), or give --link wire"
            )
        import qi

        self._qi, self._access = qi, access
        # It logs to the standard output otherwise.
        qi.logging.setLevel(qi.logging.FATAL)
        with contextlib.suppress(RuntimeError):
            self._application = qi.Application(["pepper-drake"], raw=True)
        self._session = qi.Session()
        if access.user or access.password:
            self._session.setClientAuthenticatorFactory(_AuthenticatorFactory(access))
        self._services: dict[str, Any] = {}
        self._subscribers: list[Any] = []

    async def connect(self) -> None:
        """Connects; see `Transport`."""
        try:
            await self._result(self._session.connect(self._access.address, _async=True), "connect")
        except CallError as error:
            refused = "disconnected" in str(error)
            word = "robot_refused" if refused else "robot_unreachable"
            raise LinkFault(word, self._access.address) from None

    async def call(self, service: str, method: str, *arguments: Any) -> Any:
        """Calls a method; see `Transport`."""
        if self.is_lost:
            raise LinkFault("link_lost", f"at {service}.{method}")
        if service not in self._services:
            try:
                found = await self._result(
                    self._session.service(service, _async=True), f"service {service}"
                )
            except CallError:
                raise LinkFault("service_missing", service) from None
            self._services[service] = found
        call = f"{service}.{method}"
        try:
            future = getattr(self._services[service], method)(*arguments, _async=True)
        except (AttributeError, RuntimeError) as error:
            raise LinkFault("service_missing", f"{call}: {error}") from None
        return await self._result(future, call)

    async def on_event(self, event: str, callback: Callable[[Any], None]) -> None:
        """Subscribes to an event; see `Transport`."""
        loop = asyncio.get_running_loop()
        subscriber = await self.call("ALMemory", "subscriber", event)
        self._subscribers.append(subscriber)
        subscriber.signal.connect(lambda value: loop.call_soon_threadsafe(callback, value))

    @property
    def is_lost(self) -> bool:
        """True if the connection has ended."""
        return not self._session.isConnected()

    async def close(self) -> None:
        """Ends the connection."""
        with contextlib.suppress(RuntimeError):
            self._session.close()

    async def _result(self, future: Any, call: str) -> Any:
        loop = asyncio.get_running_loop()
        done: asyncio.Future[None] = loop.create_future()

        def finish() -> None:
            if not done.done():
                done.set_result(None)

        def tell(_: Any) -> None:
            loop.call_soon_threadsafe(finish)

        future.addCallback(tell)
        try:
            await done
        except asyncio.CancelledError:
            future.cancel()
            raise
        if future.hasError():
            if self.is_lost and call != "connect":
                raise LinkFault("link_lost", f"during {call}")
            raise CallError(call, future.error())
        return future.value()


class _AuthenticatorFactory:
    """Makes the authenticator from which libqi takes user and password."""

    def __init__(self, access: RobotAccess) -> None:
        self._access = access

    def newAuthenticator(self) -> "_AuthenticatorFactory":
        """Returns itself, which has no state."""
        return self

    def initialAuthData(self) -> dict[str, str]:
        """Returns user and password."""
        return {"user": self._access.user, "token": self._access.password}


async def identity(transport: Transport) -> tuple[Any, ...]:
    """Returns the identity of a robot's session: machine, process and session of ALMotion.

    Raises:
        LinkFault: The robot does not answer.
    """
    info = await transport.call("ServiceDirectory", "service", "ALMotion")
    return tuple(info[2:4]) + tuple(info[5:])


def make_transport(access: RobotAccess) -> Transport:
    """Returns the transport of the requested kind.

    Raises:
        InputError: There is no such link, or it is not installed.
    """
    if access.link == "wire":
        return WireTransport(access)
    if access.link == "libqi":
        return LibqiTransport(access)
    raise InputError(f'link "{access.link}" is none of {", ".join(LINKS)}')
