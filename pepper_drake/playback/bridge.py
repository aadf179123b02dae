"""meshcat's own server, with access control and protection against invalid messages."""

import contextlib
import json
import os
from typing import Any

import msgpack
import tornado.web
from meshcat.servers.zmqserver import (
    VIEWER_HTML,
    VIEWER_ROOT,
    StaticFileHandlerNoCache,
    WebSocketHandler,
    ZMQWebSocketBridge,
)

from pepper_drake.playback.server import QUIT
from pepper_drake.web.access import Access
from pepper_drake.web.guarded_handler import GuardedHandler
from pepper_drake.web.page_server import quiet_tornado

_PATIENCE = 8.0
"""Timeout of commands that wait for a browser [s]."""
_IMAGE_LIMIT = 64 * 2**20
"""Largest image that a browser may send [bytes]."""
_COMMANDS = ("set_transform", "set_object", "delete", "set_property", "set_animation")
_QUERIES = ("url", "get_scene")


class Bridge(ZMQWebSocketBridge):
    """meshcat's server with access control and a command to quit.

    It answers every command, since a REP socket that does not answer blocks for ever. An
    unrequested message from a browser closes that browser's connection.
    """

    def __init__(self, zmq_url: str, access: Access) -> None:
        """Starts to listen.

        Args:
            zmq_url: Address for commands.
            access: The addresses and tokens that may open the window.
        """
        self._access = access
        self._image: object | None = None
        super().__init__(zmq_url=zmq_url, host=access.host)
        self.web_url = access.url(self.fileserver_port, "/static/")

    def make_app(self) -> tornado.web.Application:
        """Makes the web server, which listens at the access's host."""
        quiet_tornado()
        access = self._access
        static = {"path": os.path.abspath(VIEWER_ROOT), "default_filename": VIEWER_HTML}
        application = _Application(
            [
                (r"/static/(.*)", _Files, {"access": access, **static}),
                (r"/", _Window, {"access": access, "bridge": self}),
            ],
            log_function=lambda handler: None,
            websocket_max_message_size=_IMAGE_LIMIT,
            websocket_ping_interval=20,
            websocket_ping_timeout=20,
        )
        application.host = access.host
        return application

    def handle_zmq(self, frames: list[bytes]) -> None:
        """Answers one command."""
        try:
            self._handle(frames)
        except Exception as error:
            self._image = None
            with contextlib.suppress(Exception):
                self.zmq_socket.send(f"error: {type(error).__name__}".encode())

    def _handle(self, frames: list[bytes]) -> None:
        if frames == [QUIT]:
            self.zmq_socket.send(b"ok")
            self.ioloop.call_later(0.1, self.ioloop.stop)
            return
        command = frames[0].decode("utf-8", errors="replace")
        if command == "wait":
            self._wait(_PATIENCE)
        elif command == "capture_image":
            self._capture(frames)
        elif command in _QUERIES or (command in _COMMANDS and len(frames) != 3):
            super().handle_zmq(frames)
        elif command in _COMMANDS and not _is_command(frames):
            self.zmq_socket.send(b"error: expected a path and a msgpack map with a type")
        else:
            super().handle_zmq(frames)

    def _wait(self, patience: float) -> None:
        if self.websocket_pool or patience <= 0.0:
            self.zmq_socket.send(b"ok" if self.websocket_pool else b"error: no browser came")
        else:
            self.ioloop.call_later(0.1, lambda: self._wait(patience - 0.1))

    def _capture(self, frames: list[bytes]) -> None:
        if not self.websocket_pool or len(frames) != 3 or not _is_command(frames):
            self.zmq_socket.send(b"error: no browser is there to take a picture")
            return
        self._image = asked = object()
        self.forward_to_websockets(frames)

        def give_up() -> None:
            if self._image is asked:
                self._image = None
                self.zmq_socket.send(b"error: no browser has sent a picture")

        self.ioloop.call_later(_PATIENCE, give_up)

    def take_image(self, message: str | bytes) -> bool:
        """Forwards an image from a browser to the client; returns whether it was requested."""
        if self._image is None:
            return False
        data = json.loads(message)["data"]
        mime, _, _ = data.partition(",")
        if not mime.startswith("data:image/"):
            return False
        self.send_image(data)
        self._image = None
        return True


class _Application(tornado.web.Application):
    """An application that always listens at its own host."""

    host = ""

    def listen(self, port: int, address: str | None = None, **options: Any) -> Any:
        return super().listen(port, address=self.host, **options)


class _Files(GuardedHandler, StaticFileHandlerNoCache):
    """The viewer's files; only its page needs access."""

    def initialize(self, access: Access, path: str, default_filename: str) -> None:
        self.guard(access, public=self.request.path not in ("/static/", "/static/index.html"))
        StaticFileHandlerNoCache.initialize(self, path, default_filename)


class _Window(GuardedHandler, WebSocketHandler):
    """The page's websocket."""

    def initialize(self, access: Access) -> None:
        self.guard(access, public=False)

    def check_origin(self, origin: str) -> bool:
        return True  # `prepare` has checked it.

    def on_message(self, message: str | bytes) -> None:
        try:
            asked_for = self.bridge.take_image(message)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError):
            asked_for = False
        if not asked_for:
            self.close(1008, "not asked for")

    def on_close(self) -> None:
        self.bridge.websocket_pool.discard(self)


def _is_command(frames: list[bytes]) -> bool:
    """Returns whether a viewer can read a message."""
    try:
        frames[1].decode()
        fields = msgpack.unpackb(frames[2], strict_map_key=False)
    except (ValueError, RecursionError, msgpack.UnpackException):
        return False
    return isinstance(fields, dict) and isinstance(fields.get("type"), str)
