"""Viser without its open door: its server is behind a page of ours.

Viser listens for every website and lets every browser do everything. Here it listens at a socket in
a folder that only this user may enter, and a process of its own (`viser_process`) serves the page:
to whom `Access` admits, passing on only messages that it has checked and written anew.
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
        server: To draw into, and to make controls with.
        url: The address of the page that leads.
        class_url: The address of the same page for those who look on.
    """

    def __init__(self, host: str | None = None, *, keys: Sequence[str] = ()) -> None:
        """Serves a page.

        Args:
            host: Address to listen at, which then takes a token in the page's address; left out,
                the page is for this computer only.
            keys: The keys that are told, as browsers name them.

        Raises:
            InputError: The host is not an address of this computer, or no port is free.
        """
        lead, look = Access.to(host), Access.to(host)
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
        self.class_url = look.url(self._process.port, "/class")

    def events(self) -> list[dict[str, Any]]:
        """Returns what keys and game pad did since this was last asked.

        Each is `{"key": name}`, or `{"axes": [...], "buttons": [...]}`, both empty when a pad has
        gone.
        """
        return self._process.events()

    def wait_for_browser(self) -> None:
        """Waits until somebody has opened the page."""
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
    """Starts viser at a socket of the file system; it has no option for it."""
    rich.get_console().quiet = True  # Viser would announce an address that is not ours.
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
