"""Serves a page to untrusted browsers."""

import asyncio
import contextlib
import logging
import socket
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import tornado.web
from tornado.httpserver import HTTPServer
from tornado.iostream import StreamClosedError
from tornado.netutil import bind_sockets
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from pepper_drake.errors import InputError
from pepper_drake.web.access import Access
from pepper_drake.web.guarded_handler import GuardedHandler
from pepper_drake.web.messages import MESSAGE_LIMIT
from pepper_drake.web.retained_scene import RetainedScene

FIRST_PORT = 7000
"""First port to try; pages take the first free one."""

_PORTS = 100
_MOST_BROWSERS = 64
_MOST_UNSENT = 64 * 2**20
"""Unsent data at which a browser is disconnected [bytes]: it hangs, or its computer sleeps."""
_PING_PERIOD, _PING_TIMEOUT = 20, 20  # [s]
_TRY_AGAIN = 1013
"""Code with which a websocket is closed (registry of RFC 6455)."""


@dataclass(frozen=True)
class Asset:
    """A file of the page: its content and its media type."""

    content: bytes
    media_type: str


class PageServer:
    """A page, its files, and the browsers that have it open; all in one event loop.

    Messages of `broadcast` go to all browsers, and to later ones as far as they are still valid.
    Messages from browsers are ignored.
    """

    def __init__(
        self,
        assets: Mapping[str, Asset],
        access: Access,
        on_open: Callable[[], None],
    ) -> None:
        """Makes a server that does not listen yet.

        Args:
            assets: The page's files by path; "/" is the page.
            access: Who may open it.
            on_open: Called when a browser has opened the page.
        """
        self._access, self._assets, self._on_open = access, assets, on_open
        self._scene = RetainedScene()
        self._browsers: set[_Browser] = set()

    def listen(self) -> int:
        """Starts to serve, and returns the port.

        Raises:
            InputError: No port is free.
        """
        options = {"access": self._access, "assets": self._assets, "server": self}
        return listen([(r"(/.*)", _Page, options)], self._access.host)

    def broadcast(self, data: bytes) -> None:
        """Sends a message to all browsers."""
        self._scene.add(data)
        for browser in tuple(self._browsers):
            browser.send(data)

    def enter(self, browser: "_Browser") -> bool:
        """Sends the present scene to a new browser; returns False if there are too many."""
        if len(self._browsers) >= _MOST_BROWSERS:
            return False
        self._browsers.add(browser)
        for data in self._scene.messages():
            browser.send(data)
        self._on_open()
        return True

    def leave(self, browser: "_Browser") -> None:
        """Removes a disconnected browser."""
        self._browsers.discard(browser)


def quiet_tornado() -> None:
    """Suppresses log messages about malformed requests."""
    for name in ("access", "application", "general"):
        logging.getLogger(f"tornado.{name}").setLevel(logging.CRITICAL)


def listen(handlers: Sequence[tuple[str, type, dict[str, Any]]], host: str) -> int:
    """Starts to serve pages, within limits of size and time, and returns the port.

    Args:
        handlers: Paths with their handler classes and constructor arguments.
        host: Address to listen at.

    Raises:
        InputError: No port is free.
    """
    quiet_tornado()
    application = tornado.web.Application(
        handlers,
        log_function=lambda handler: None,
        websocket_ping_interval=_PING_PERIOD,
        websocket_ping_timeout=_PING_TIMEOUT,
        websocket_max_message_size=MESSAGE_LIMIT,
    )
    http = HTTPServer(
        application,
        max_header_size=16 * 2**10,
        max_body_size=2**10,
        idle_connection_timeout=60,
        body_timeout=10,
    )
    sockets = listening_sockets(host)
    http.add_sockets(sockets)
    return int(sockets[0].getsockname()[1])


def listening_sockets(host: str) -> list[socket.socket]:
    """Returns sockets that listen at the first free port from `FIRST_PORT` on.

    Raises:
        InputError: No port is free.
    """
    for port in (*range(FIRST_PORT, FIRST_PORT + _PORTS), 0):
        with contextlib.suppress(OSError):
            return bind_sockets(port, host)
    raise InputError(f"no page can be served at {host}; try another --host")


class _Page(GuardedHandler, WebSocketHandler):
    """Handler of the page's files, and of its websocket at the same path as the page."""

    def initialize(self, access: Access, assets: Mapping[str, Asset], server: PageServer) -> None:
        # The viewer's script is public; only the page and its websocket need the token.
        self.guard(access, public=self.request.path not in ("/", "/index.html"))
        self._assets, self._server = assets, server
        self._browser = _Browser(self)

    async def get(self, path: str) -> None:
        path = "/" if path == "/index.html" else path
        if path == "/" and self.request.headers.get("Upgrade", "").lower() == "websocket":
            await super().get(path)
            return
        asset = self._assets.get(path)
        if asset is None:
            self.send_error(404)
            return
        self.set_header("Content-Type", asset.media_type)
        self.finish(asset.content)

    def check_origin(self, origin: str) -> bool:
        return True  # `prepare` has checked it.

    def open(self, *args: str, **kwargs: str) -> None:
        if not self._server.enter(self._browser):
            self.close(_TRY_AGAIN, "too many browsers have this page open")

    def on_message(self, message: bytes | str) -> None:
        """Ignores the browser's messages, which are about its camera and gamepad."""

    def on_close(self) -> None:
        self._server.leave(self._browser)


class _Browser:
    """One browser's connection, with the size of its unsent messages."""

    def __init__(self, handler: WebSocketHandler) -> None:
        self._handler, self._unsent = handler, 0

    def send(self, data: bytes) -> None:
        """Sends a message, or disconnects a browser that is too slow."""
        self._unsent += len(data)
        if self._unsent > _MOST_UNSENT:
            self._handler.close(_TRY_AGAIN, "too slow")
            return
        try:
            sending = asyncio.ensure_future(self._handler.write_message(data, binary=True))
        except WebSocketClosedError:
            return
        sending.add_done_callback(lambda done: self._sent(done, len(data)))

    def _sent(self, done: "asyncio.Future[None]", size: int) -> None:
        self._unsent -= size
        if not done.cancelled():
            error = done.exception()
            assert error is None or isinstance(error, WebSocketClosedError | StreamClosedError)
