"""Drake's Meshcat without its open door: to record with, or behind a page of ours.

A Meshcat listens from when it is made: at every address of the computer if not told otherwise, for
every website, and its reader of messages ends the program at a byte that it does not expect. Here
its door is shut right after it was made. A page is shown by a `PageServer`, which alone is
connected to it, and which tells it nothing of what browsers send.
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
    """Meshcats that nobody uses at the moment; each may be touched by its own thread only."""

    def __init__(self) -> None:
        self.meshcats: list[Meshcat] = []


_SPARE = _Spare()
"""A Meshcat that goes on another thread than it was made on ends the program, and Python's garbage
collector runs on any thread. So none ever goes: whoever needs the next one gets it."""


@contextlib.contextmanager
def offline_meshcat() -> Iterator[Meshcat]:
    """Gives a Meshcat to draw into and to record with, which nobody can connect to.

    Nothing may draw into it after the `with` statement.
    """
    if _SPARE.meshcats:
        meshcat = _SPARE.meshcats.pop()
    else:
        meshcat = _loopback_meshcat()
        _shut(meshcat)
    try:
        yield meshcat
    finally:
        _put_away(meshcat)


class DrakePage:
    """A Meshcat and the page that shows it; use it in a `with` statement, or call `close`.

    Attributes:
        meshcat: To draw into, on the thread that made the page, until it is closed.
        url: The page's address for the browser.
        ws_url: The address of its websocket.
    """

    def __init__(self, host: str | None = None) -> None:
        """Serves a page, from a process of its own.

        Args:
            host: Address to listen at, which then takes a token in the page's address; left out,
                the page is for this computer only.

        Raises:
            InputError: The host is not an address of this computer, or no port is free.
        """
        access = Access.to(host)
        self.meshcat = _loopback_meshcat()
        order = {"meshcat": self.meshcat.web_url(), "host": access.host, "token": access.token}
        try:
            self._process = ServedProcess("pepper_drake.web.page_process", order)
        except BaseException:
            _shut(self.meshcat)
            _put_away(self.meshcat)
            raise
        _shut(self.meshcat)
        self.url = access.url(self._process.port)
        self.ws_url = self.url.replace("http://", "ws://")

    def wait_for_browser(self) -> None:
        """Waits until somebody has opened the page."""
        while not self._process.wait(1.0):
            pass

    def close(self) -> None:
        """Ends the page; it may be called twice."""
        if not self._process.is_closed:
            self._process.close()
            _put_away(self.meshcat)

    def __enter__(self) -> "DrakePage":
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()


@contextlib.contextmanager
def open_meshcat(
    *, page: bool, host: str | None = None
) -> Iterator[tuple[Meshcat, DrakePage | None]]:
    """Gives a Meshcat and its page, if there is one.

    Args:
        page: Whether anybody may look on; if not, nothing listens anywhere.
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


def _put_away(meshcat: Meshcat) -> None:
    """Empties a Meshcat for whoever needs one next."""
    meshcat.Delete("")
    meshcat.DeleteRecording()
    meshcat.SetAnimation(MeshcatAnimation(1.0))
    meshcat.DeleteAddedControls()
    meshcat.SetCameraTarget([0.0, 0.0, 0.0])
    meshcat.ResetRenderMode()
    _SPARE.meshcats.append(meshcat)


def _shut(meshcat: Meshcat) -> None:
    """Closes the socket at which a Meshcat listens; its connections stay.

    Drake has no option for it. Something harmless takes the descriptor's place, so that Meshcat
    closes in the end what it believes to be its socket.
    """
    descriptor = _listening_descriptor(meshcat.port())
    nothing = os.open(os.devnull, os.O_RDWR | os.O_CLOEXEC)
    os.dup2(nothing, descriptor, inheritable=False)
    os.close(nothing)


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
