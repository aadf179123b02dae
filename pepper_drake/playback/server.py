"""meshcat's own server as a process that outlives the app, so that its window stays open.

Run as a module, it serves until it is told to quit. An app draws into any meshcat server that
answers at its address, this one or a stock `meshcat-server`.
"""

import contextlib
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from ipaddress import ip_address
from typing import TYPE_CHECKING
from urllib.parse import urlsplit

import zmq

from pepper_drake.errors import InputError
from pepper_drake.web.access import Access

if TYPE_CHECKING:
    from pepper_drake.playback.drawing import Command

DEFAULT_URL = "tcp://127.0.0.1:6000"
"""Default address of a meshcat server."""

_ANSWER_MS = 10_000
_START_SECONDS = 20.0
QUIT = b"quit"
"""The command that ends the server."""
_KEEP = b"keep"
"""Data on a server's standard input that keeps the server alive after the input closes."""


def is_listening(url: str) -> bool:
    """True if a server listens at an address such as tcp://127.0.0.1:6000.

    Raises:
        InputError: The address is invalid.
    """
    parts = urlsplit(url)
    try:
        address = (parts.hostname, parts.port)
    except ValueError:
        address = (None, None)
    if parts.scheme != "tcp" or None in address:
        raise InputError(f'--zmq-url is "{url}"; it must be like {DEFAULT_URL}')
    with contextlib.suppress(OSError), socket.create_connection(address, timeout=1.0):
        return True
    return False


def start_server(url: str, host: str | None = None) -> subprocess.Popen[bytes]:
    """Starts a server at an address in a separate process, without waiting for it.

    The server ends whenever this process ends, unless `keep_server` is called before.

    Args:
        url: Address for commands. Only this computer may reach it, since commands can run any code
            in the browsers.
        host: Address at which other computers, too, can open the window, by a URL with a token.

    Raises:
        InputError: Other computers could send commands to the address, or the host is invalid.
    """
    name = urlsplit(url).hostname or ""
    try:
        is_here = name == "localhost" or ip_address(name).is_loopback
    except ValueError:
        is_here = False
    if not is_here:
        raise InputError(
            f'--zmq-url "{url}": a server is started for this computer only; give 127.0.0.1, and '
            "--host to show its window to others"
        )
    Access.to(host)
    hosts = [] if host is None else [host]
    return subprocess.Popen(
        [sys.executable, "-m", "pepper_drake.playback.server", url, *hosts],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def wait_for_server(url: str, server: subprocess.Popen[bytes]) -> None:
    """Waits until a started server listens.

    Raises:
        InputError: It ended, or does not listen in time, perhaps because of the address.
    """
    deadline = time.monotonic() + _START_SECONDS
    while not is_listening(url):
        if server.poll() is not None or time.monotonic() > deadline:
            raise InputError(f"{url}: no meshcat server can be started here; try another --zmq-url")
        time.sleep(0.02)


def keep_server(server: subprocess.Popen[bytes]) -> None:
    """Lets a started server outlive this process.

    Raises:
        InputError: The server has ended.
    """
    assert server.stdin is not None
    try:
        server.stdin.write(_KEEP)
        server.stdin.close()
    except BrokenPipeError:
        raise InputError("the meshcat server has ended; play again") from None


def send(commands: "Sequence[Command]", url: str) -> str:
    """Sends commands to a running server.

    Args:
        commands: Commands from `draw`.
        url: The server's address.

    Returns:
        The address for the browser.

    Raises:
        InputError: No meshcat server answers.
    """
    web_url = _ask(url, [b"url"]).decode()
    with _connection(url) as connection:
        for command in commands:
            # The stock server does not know controls, but forwards and keeps properties
            # unchanged; the viewer reads the type from the data.
            kind = "set_property" if command.kind == "set_control" else command.kind
            message = [kind.encode(), command.path.encode(), command.data]
            answer = _exchange(connection, message, url)
            if answer != b"ok":
                raise InputError(f"{url}: the server says {answer.decode(errors='replace')}")
    return web_url


def quit_server(url: str) -> None:
    """Ends a server that `start_server` started, and waits until its address is free.

    Raises:
        InputError: There is no server, or it was started otherwise.
    """
    if not is_listening(url):
        raise InputError(f"{url}: there is no server to stop")
    if _ask(url, [QUIT]) != b"ok":
        raise InputError(f"{url}: this server was not started by play.py; end it where it began")
    deadline = time.monotonic() + _START_SECONDS
    while is_listening(url) and time.monotonic() < deadline:
        time.sleep(0.02)


def _ask(url: str, message: list[bytes]) -> bytes:
    with _connection(url) as connection:
        return _exchange(connection, message, url)


def _connection(url: str) -> zmq.Socket[bytes]:
    connection: zmq.Socket[bytes] = zmq.Context.instance().socket(zmq.REQ)
    connection.linger = 0
    connection.rcvtimeo = connection.sndtimeo = _ANSWER_MS
    connection.connect(url)
    return connection


def _exchange(connection: zmq.Socket[bytes], message: list[bytes], url: str) -> bytes:
    try:
        connection.send_multipart(message)
        return bytes(connection.recv())
    except zmq.ZMQError:
        raise InputError(f"{url}: no meshcat server answers here; try another --zmq-url") from None


def serve(url: str, host: str | None = None) -> None:
    """Serves at an address until told to quit.

    Args:
        url: Address for commands, on this computer.
        host: Host for browsers; see `Access.to`.
    """
    from pepper_drake.playback.bridge import Bridge

    Bridge(url, Access.to(host)).run()


def _end_unless_kept() -> None:
    received = b""
    while more := os.read(sys.stdin.fileno(), len(_KEEP) + 1):
        received += more
    if received != _KEEP:
        os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=_end_unless_kept, daemon=True).start()
    serve(*sys.argv[1:])
