"""Process that serves a viser page; see `served_process` for its input and output."""

import asyncio
import contextlib
import json
import sys
from pathlib import Path
from typing import Any

import viser
from tornado.websocket import WebSocketClosedError, WebSocketHandler
from websockets.asyncio.client import ClientConnection, unix_connect
from websockets.exceptions import ConnectionClosed, WebSocketException
from websockets.typing import Subprotocol

from pepper_drake.errors import PepperDrakeError
from pepper_drake.web.access import Access
from pepper_drake.web.guarded_handler import GuardedHandler
from pepper_drake.web.messages import BadMessageError, read_gamepad
from pepper_drake.web.page_server import listen
from pepper_drake.web.viser_messages import checked

_POLICY_VIOLATION, _TRY_AGAIN = 1008, 1013
_MOST_BROWSERS = 64
_SCRIPT, _BANNER = (Path(__file__).with_name(f"page_{name}.js") for name in ("input", "banner"))
_WATCHES = "You are watching; the teacher has the controls. Turn the view with the mouse."
_STYLE = b"""<title>Pepper</title><style>.banner{position:fixed;left:50%;bottom:12px;z-index:2000;
width:max-content;max-width:90vw;transform:translateX(-50%);padding:6px 12px;background:#1c3d5a;
color:#fff;font:14px sans-serif;
pointer-events:none}.banner[hidden]{display:none}@media (max-width:36em){
#root>div>div>div:has(canvas){flex-direction:column}#root>div>div>div>div:has(canvas){min-height:0}
.mantine-Paper-root[style*="max-height: 60%"]{position:static!important;flex:none;
width:100%!important;max-height:50%!important}
.mantine-Paper-root [style*="width: 20em"]{width:100%!important}.banner{bottom:auto;top:12px}}
</style>"""
"""On a narrow screen viser's panel would cover the view; it stands below the view."""
_NO_CONTROLS = b"""<style>.mantine-Button-root,.mantine-Slider-root,.mantine-Checkbox-root,
[class^=multi-slider]{opacity:.4;pointer-events:none}</style>"""
"""Who looks on turns the pages of the controls, and moves none of them."""


def _tell(event: dict[str, Any]) -> None:
    print(json.dumps(event), flush=True)


class _Page(GuardedHandler, WebSocketHandler):
    """The page, and its websocket at the same address, which is forwarded to viser's."""

    browsers = 0

    def initialize(self, access: Access, leads: bool, html: bytes, path: str) -> None:
        self.guard(access, public=False)
        self._leads, self._html, self._path = leads, html, path
        self._upstream: ClientConnection | None = None
        self._is_counted = False

    async def get(self, *arguments: str, **named: str) -> None:
        if self.request.headers.get("Upgrade", "").lower() == "websocket":
            await super().get(*arguments, **named)
            return
        self.set_header("Content-Type", "text/html; charset=utf-8")
        self.finish(self._html)

    def head(self, *arguments: str, **named: str) -> None:
        """Answers an open page that asks whether the program still serves it."""

    def check_origin(self, origin: str) -> bool:
        return True  # `prepare` has checked it.

    def select_subprotocol(self, subprotocols: list[str]) -> str | None:
        return next((name for name in subprotocols if name.startswith("viser-v")), None)

    async def open(self, *arguments: str, **options: str) -> None:
        if _Page.browsers >= _MOST_BROWSERS:
            self.close(_TRY_AGAIN, "too many browsers have this page open")
            return
        _Page.browsers += 1
        self._is_counted = True
        self.set_nodelay(True)  # A frame must not wait for the acknowledgement of the last one.
        subprotocol = Subprotocol(f"viser-v{viser.__version__}")
        try:
            self._upstream = await unix_connect(
                self._path,
                uri="ws://page/",
                subprotocols=[subprotocol],
                compression=None,
                max_size=None,
                ping_interval=None,
            )
        except (OSError, WebSocketException):
            self.close(_TRY_AGAIN, "the session has ended")
            return
        self._showing = asyncio.ensure_future(self._show(self._upstream))
        _tell({"opened": self._leads})

    async def _show(self, upstream: ClientConnection) -> None:
        """Forwards viser's messages as fast as the browser accepts them."""
        with contextlib.suppress(ConnectionClosed, WebSocketClosedError):
            async for data in upstream:
                await self.write_message(data, binary=True)
        self.close()

    async def on_message(self, message: bytes | str) -> None:
        try:
            data = checked(message, leads=self._leads)
        except BadMessageError as error:
            self.close(_POLICY_VIOLATION, str(error))
            return
        if data is not None and self._upstream is not None:
            with contextlib.suppress(ConnectionClosed):
                await self._upstream.send(data)

    def on_close(self) -> None:
        _Page.browsers -= self._is_counted
        if self._upstream is not None:
            asyncio.ensure_future(self._upstream.close())  # noqa: RUF006 It ends by itself.


class _Input(GuardedHandler, WebSocketHandler):
    """Keyboard and gamepad of a controlling page."""

    holder: "_Input | None" = None
    """The page whose gamepad is used."""

    def initialize(self, access: Access, keys: frozenset[str]) -> None:
        self.guard(access, public=False)
        self._keys = keys

    def check_origin(self, origin: str) -> bool:
        return True  # `prepare` has checked it.

    def on_message(self, message: bytes | str) -> None:
        try:
            self._read(message)
        except (BadMessageError, ValueError, RecursionError):
            self.close(_POLICY_VIOLATION, "no key and no game pad")

    def _read(self, message: bytes | str) -> None:
        fields = json.loads(message)
        if not isinstance(fields, dict) or len(fields) != 1:
            raise BadMessageError("no map of one")
        if "key" in fields:
            key = fields["key"]
            if not isinstance(key, str) or key not in self._keys:
                raise BadMessageError("an unknown key")
            _tell({"key": key})
            return
        pad = read_gamepad(fields.get("gamepad"))
        if pad.index is None and self is not _Input.holder:
            return
        _Input.holder = self if pad.index is not None else None
        _tell({"axes": pad.axes, "buttons": pad.buttons})

    def on_close(self) -> None:
        if self is _Input.holder:
            _Input.holder = None
            _tell({"axes": [], "buttons": []})


def _head(banner: str) -> bytes:
    """Returns what a page has in its head besides viser's own, with what its banner says."""
    return (
        _STYLE
        + f"<script>const PEPPER_BANNER={json.dumps(banner)};".encode()
        + _BANNER.read_bytes()
        + b"</script>"
    )


def serve(order: dict[str, Any]) -> int:
    """Starts to serve, and returns the port.

    Args:
        order: Fields `socket`, viser's socket; `lead` and `look`, the `Access` of the controlling
            page and of spectators; and `keys`, the keys that cause events.
    """
    lead, look = Access(**order["lead"]), Access(**order["look"])
    html = (Path(viser.__file__).parent / "client" / "build" / "index.html").read_bytes()
    before, head, after = html.partition(b"</head>")
    setting = json.dumps(order["keys"]).encode()
    script = b"<script>const PEPPER_KEYS=" + setting + b";\n" + _SCRIPT.read_bytes() + b"</script>"
    options = {"path": order["socket"]}
    leading = options | {
        "access": lead,
        "leads": True,
        "html": before + _head("") + script + head + after,
    }
    looking = options | {
        "access": look,
        "leads": False,
        "html": before + _head(_WATCHES) + _NO_CONTROLS + head + after,
    }
    handlers = [
        (r"/(?:index\.html)?", _Page, leading),
        (r"/class(?:/(?P<token>[^/]+))?/?", _Page, looking),
        (r"/input", _Input, {"access": lead, "keys": frozenset(order["keys"])}),
    ]
    return listen(handlers, lead.host)


async def main() -> None:
    """Serves until the standard input ends."""
    try:
        answer: dict[str, Any] = {"port": serve(json.loads(sys.stdin.readline()))}
    except (PepperDrakeError, OSError, ValueError) as error:
        answer = {"error": str(error)}
    _tell(answer)
    if "error" not in answer:
        await asyncio.to_thread(sys.stdin.read)


if __name__ == "__main__":
    asyncio.run(main())
