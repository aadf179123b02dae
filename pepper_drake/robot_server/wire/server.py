"""A QiMessaging server: services at an address, for any NAOqi client."""

import asyncio
import itertools
import ssl
from collections.abc import Callable, Sequence

from pepper_drake.errors import InputError
from pepper_drake.robot_server.wire.connection import Connection, Credentials
from pepper_drake.robot_server.wire.directory import Directory
from pepper_drake.robot_server.wire.objects import ClientObject
from pepper_drake.robot_server.wire.service import Caller, Service, ServiceError

LOOPBACK = "127.0.0.1"
PORT = 9559
"""NAOqi's port."""
_CLIENTS = 64
"""Most clients at a time."""
_LONGEST_READ = 2**20
"""Size of a connection's read buffer [bytes]."""


class QiServer:
    """Services with a directory, listening at one address.

    Attributes:
        directory: The service directory.
        port: The port; known after `start`.
    """

    def __init__(
        self,
        services: Sequence[Service],
        *,
        host: str = LOOPBACK,
        port: int = PORT,
        credentials: Credentials | None = None,
        tls: ssl.SSLContext | None = None,
        log: Callable[[str], None] = lambda _: None,
    ) -> None:
        """Makes a server; `start` starts it.

        Args:
            services: To serve.
            host: Address to listen at.
            port: Port; 0 for a free one.
            credentials: User and password required of clients.
            tls: Context for an encrypted port (tcps), or None.
            log: Takes a line for the user.

        Raises:
            InputError: Other machines could connect without a password.
        """
        if host not in (LOOPBACK, "::1", "localhost") and credentials is None:
            raise InputError(
                f"--host {host} opens the robot to other machines; give --password-file, too"
            )
        self._host, self.port = host, port
        self._credentials, self._tls, self._log = credentials, tls, log
        self._numbers = itertools.count(1)
        self._connections: dict[int, tuple[Connection, asyncio.Task[None], str]] = {}
        self._server: asyncio.Server | None = None
        self.directory = Directory(self._endpoints, lambda c: self._connections[c.client][0])
        for service in services:
            self.directory.add(service)

    async def start(self) -> None:
        """Starts listening.

        Raises:
            InputError: The address is in use, or not of this machine.
        """
        try:
            self._server = await asyncio.start_server(
                self._accept, self._host, self.port, ssl=self._tls, limit=_LONGEST_READ
            )
        except OSError as error:
            raise InputError(
                f"cannot listen at {self._host}:{self.port} ({error.strerror}); "
                "choose another --port"
            ) from None
        self.port = self._server.sockets[0].getsockname()[1]

    @property
    def address(self) -> str:
        """The address for clients, such as `tcp://127.0.0.1:9559`."""
        return f"{'tcps' if self._tls else 'tcp'}://{self._host}:{self.port}"

    def service(self, number: int) -> Service | None:
        """Returns a service by its number; see `Objects`."""
        return self.directory.by_number(number)

    def find(self, name: str) -> "Service | ClientService | None":
        """Returns a service by name, ours or a client's; see `ServiceFinder`."""
        ours = next((s for s in self.directory.services() if s.name == name), None)
        if ours is None and self.directory.has_client_service(name):
            return ClientService(self.directory, name)
        return ours

    async def close(self) -> None:
        """Stops listening and disconnects all clients."""
        if self._server is not None:
            self._server.close()
        ends = [task for _, task, _ in self._connections.values()]
        for connection, _, _ in list(self._connections.values()):
            connection.abort()
        await asyncio.gather(*ends, return_exceptions=True)

    def restart(self) -> None:
        """Ends all connections and begins another session, as a robot's reboot does."""
        self.directory.session += 1
        for connection, _, _ in self._connections.values():
            connection.abort()

    def _endpoints(self, caller: Caller) -> list[str]:
        """Returns the addresses for a client: those to which it connected."""
        _, _, host = self._connections[caller.client]
        return [f"{'tcps' if self._tls else 'tcp'}://{host}:{self.port}"]

    async def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        if len(self._connections) >= _CLIENTS:
            self._log(f"more than {_CLIENTS} clients; one was refused")
            writer.close()
            return
        peer = writer.get_extra_info("peername") or ("", 0)
        local = writer.get_extra_info("sockname") or (self._host, self.port)
        caller = Caller(next(self._numbers), f"{peer[0]}:{peer[1]}")
        connection = Connection(reader, writer, caller, self, self._credentials, self._log)
        host = f"[{local[0]}]" if ":" in local[0] else local[0]
        self._connections[caller.client] = (connection, task, host)
        try:
            await connection.serve()
        finally:
            for service in self.directory.services():
                if service.on_client_left is not None:
                    service.on_client_left(connection.caller)
            self.directory.client_left(connection)
            del self._connections[caller.client]


class ClientService:
    """A client's registered service, looked up at each call."""

    def __init__(self, directory: Directory, name: str) -> None:
        """Stores the name.

        Args:
            directory: Where it is registered.
            name: Its name.
        """
        self._directory, self._name = directory, name

    async def call(self, method: str, *arguments: object) -> object:
        """Calls a method there; see `RemoteObject`."""
        found: ClientObject | None = await self._directory.find_client_service(self._name)
        if found is None:
            raise ServiceError(f"{self._name} has left")
        return await found.call(method, *arguments)
