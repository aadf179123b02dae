"""Viser without its open port, behind our own page server.

Viser accepts every website and lets every browser do everything. Here it listens at a socket in a
folder that only this user may enter, and a separate process (`viser_process`) serves the page to
clients that `Access` admits, forwarding only messages that it has checked and re-encoded.
"""

import tempfile
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any
from unittest.mock import patch

import rich
import viser
import websockets.asyncio.server

from pepper_drake.errors import PepperDrakeError
from pepper_drake.web.access import Access
from pepper_drake.web.served_process import ServedProcess


class ViserPage:
    """A viser server and the page that shows it; use it in a `with` statement, or call `close`.

    Attributes:
        server: For drawing and for making controls.
        url: Address of the page that controls the session.
        class_url: Address of the same page for spectators.
        is_local: Whether only this computer can open it.
    """

    def __init__(self, host: str | None = None, *, keys: Sequence[str] = ()) -> None:
        """Serves a page.

        Args:
            host: Address to listen at; the page's address then contains a token. If omitted, the
                page is for this computer only.
            keys: The keys that cause events, as browsers name them.

        Raises:
            InputError: The host is not an address of this computer, or no port is free.
        """
        lead = Access.to(host)
        look = lead.for_class()
        # Only this user may enter such a folder.
        self._folder = tempfile.TemporaryDirectory(prefix="pepper-page-")
        path = Path(self._folder.name) / "viser"
        self.server = _server_at(path)
        try:
            self._process = ServedProcess(
                "pepper_drake.web.viser_process",
                {
                    "socket": str(path),
                    "lead": asdict(lead),
                    "look": asdict(look),
                    "keys": list(keys),
                },
            )
        except BaseException:
            self._stop()
            raise
        self.url = lead.url(self._process.port)
        self.class_url = look.url(self._process.port, "/class", typed=True)
        self.is_local = lead.token is None

    def events(self) -> list[dict[str, Any]]:
        """Returns the events of keys and gamepad since the last call.

        Each is `{"key": name}`, or `{"axes": [...], "buttons": [...]}`, both empty after a gamepad
        was unplugged.
        """
        return self._process.events()

    def wait_for_browser(self) -> None:
        """Waits until a browser has opened the page."""
        while not self._process.wait(1.0):
            pass

    def close(self) -> None:
        """Ends the page; may be called twice."""
        if not self._process.is_closed:
            self._process.close()
            self._stop()

    def _stop(self) -> None:
        self.server.stop()
        self._folder.cleanup()

    def __enter__(self) -> "ViserPage":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


def _server_at(path: Path) -> viser.ViserServer:
    """Starts viser at a Unix socket, for which it has no option."""
    rich.get_console().quiet = True  # Viser would announce its own address.
    serve_anywhere = websockets.asyncio.server.serve

    def serve(handler: Any, host: str, port: int, **options: Any) -> Any:
        return serve_anywhere(handler, unix=True, path=str(path), **options)

    with patch.object(websockets.asyncio.server, "serve", serve):
        server = viser.ViserServer(verbose=False)
    if not path.is_socket():
        server.stop()
        raise PepperDrakeError(
            "viser listens at an open port; install the version of constraints.txt"
        )
    return server
