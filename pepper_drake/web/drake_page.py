"""Drake's Meshcat without its open port: for recording, or behind our own page server.

A Meshcat listens as soon as it is made: by default at every address of the computer, for every
website, and an unexpected byte in a message ends the program. Here its listening socket is closed
right after construction. A `PageServer`, the only client, shows its page and forwards nothing that
browsers send.
"""

import contextlib
import os
import socket
import stat
import threading
from collections.abc import Iterator
from pathlib import Path

from pydrake.geometry import Meshcat, MeshcatAnimation, MeshcatParams

from pepper_drake.errors import InputError, PepperDrakeError
from pepper_drake.web.access import LOOPBACK, Access
from pepper_drake.web.served_process import ServedProcess


class _Spare(threading.local):
    """Meshcats not in use; each may be used on its own thread only."""

    def __init__(self) -> None:
        self.meshcats: list[Meshcat] = []


_SPARE = _Spare()
"""A Meshcat that is destroyed on another thread than it was made on ends the program, and Python's
garbage collector runs on any thread. So none is ever destroyed, but reused."""


@contextlib.contextmanager
def offline_meshcat() -> Iterator[Meshcat]:
    """Yields a Meshcat for drawing and recording that accepts no connections.

    It must not be used after the `with` statement.
    """
    if _SPARE.meshcats:
        meshcat = _SPARE.meshcats.pop()
    else:
        meshcat = _loopback_meshcat()
        _close_socket(meshcat)
    try:
        yield meshcat
    finally:
        _keep_for_reuse(meshcat)


class DrakePage:
    """A Meshcat and the page that shows it; use it in a `with` statement, or call `close`.

    Attributes:
        meshcat: For drawing, on the thread that made the page, until it is closed.
        url: Address of the page.
        ws_url: Address of its websocket.
    """

    def __init__(self, host: str | None = None) -> None:
        """Serves a page from a separate process.

        Args:
            host: Address to listen at; the page's address then contains a token. If omitted, the
                page is for this computer only.

        Raises:
            InputError: The host is not an address of this computer, or no port is free.
        """
        access = Access.to(host)
        self.meshcat = _loopback_meshcat()
        order = {"meshcat": self.meshcat.web_url(), "host": access.host, "token": access.token}
        try:
            self._process = ServedProcess("pepper_drake.web.page_process", order)
        except BaseException:
            _close_socket(self.meshcat)
            _keep_for_reuse(self.meshcat)
            raise
        _close_socket(self.meshcat)
        self.url = access.url(self._process.port)
        self.ws_url = self.url.replace("http://", "ws://")

    def wait_for_browser(self) -> None:
        """Waits until a browser has opened the page."""
        while not self._process.wait(1.0):
            pass

    def close(self) -> None:
        """Ends the page; may be called twice."""
        if not self._process.is_closed:
            self._process.close()
            _keep_for_reuse(self.meshcat)

    def __enter__(self) -> "DrakePage":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


@contextlib.contextmanager
def open_meshcat(
    *, page: bool, host: str | None = None
) -> Iterator[tuple[Meshcat, DrakePage | None]]:
    """Yields a Meshcat and its page, if there is one.

    Args:
        page: Whether to serve a page; if False, nothing listens anywhere.
        host: See `DrakePage`.

    Raises:
        InputError: The page cannot be served, or there is a host and no page.
    """
    if page:
        with DrakePage(host) as shown:
            yield shown.meshcat, shown
    elif host is not None:
        raise InputError("--host: there is no page; give --live, too")
    else:
        with offline_meshcat() as meshcat:
            yield meshcat, None


def _loopback_meshcat() -> Meshcat:
    return Meshcat(MeshcatParams(host=LOOPBACK, port=0))


def _keep_for_reuse(meshcat: Meshcat) -> None:
    """Resets a Meshcat and stores it for reuse."""
    meshcat.Delete("")
    meshcat.DeleteRecording()
    meshcat.SetAnimation(MeshcatAnimation(1.0))
    meshcat.DeleteAddedControls()
    meshcat.SetCameraTarget([0.0, 0.0, 0.0])
    meshcat.ResetRenderMode()
    _SPARE.meshcats.append(meshcat)


def _close_socket(meshcat: Meshcat) -> None:
    """Closes the socket at which a Meshcat listens; its connections stay open.

    Drake has no option for it. The null device replaces the descriptor, so that Meshcat can later
    close it as if it were its socket.
    """
    descriptor = _listening_descriptor(meshcat.port())
    null = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
    os.dup2(null, descriptor, inheritable=False)
    os.close(null)


def _listening_descriptor(port: int) -> int:
    for entry in Path("/dev/fd").iterdir():
        descriptor = int(entry.name)
        try:
            if not stat.S_ISSOCK(os.fstat(descriptor).st_mode):
                continue
            with socket.socket(fileno=os.dup(descriptor)) as found:
                listens = found.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
                if listens and found.getsockname()[1] == port:
                    return descriptor
        except OSError:  # Closed meanwhile, or of another family.
            continue
    raise PepperDrakeError(f"Meshcat does not listen at port {port}, where it says that it does")
