"""Separate process that serves a page, to isolate the session from browsers."""

import contextlib
import json
import queue
import subprocess
import sys
import threading
from collections.abc import Mapping
from typing import Any

from pepper_drake.errors import InputError

_END_SECONDS = 10.0
_MOST_EVENTS = 1000
"""Largest number of unread events; further ones are dropped: nobody presses keys so fast."""


class ServedProcess:
    """Runs a module that serves a page, and receives its events.

    The module reads an order, one line of JSON, from its standard input; answers with the line
    `{"port": N}` or `{"error": "..."}`; prints events, one line of JSON each; and ends when its
    standard input does.

    Attributes:
        port: Port at which it listens.
    """

    def __init__(self, module: str, order: Mapping[str, Any]) -> None:
        """Starts the process.

        Args:
            module: Name of the module, as for `python -m`.
            order: Passed on standard input, as other users can see the arguments of a process.

        Raises:
            InputError: The page cannot be served.
        """
        self._process = subprocess.Popen(
            [sys.executable, "-m", module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            # Only the session receives Ctrl-C, and then ends the page.
            start_new_session=True,
        )
        self._events: queue.Queue[dict[str, Any]] = queue.Queue(_MOST_EVENTS)
        try:
            self.port = self._start(order)
        except BaseException:
            self.close()
            raise
        threading.Thread(target=self._listen, daemon=True).start()

    def _start(self, order: Mapping[str, Any]) -> int:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(json.dumps(order).encode() + b"\n")
            self._process.stdin.flush()
        answer = json.loads(self._process.stdout.readline() or '{"error": "it ends at once"}')
        if "error" in answer:
            raise InputError(f"no page can be served: {answer['error']}")
        return int(answer["port"])

    def _listen(self) -> None:
        assert self._process.stdout is not None
        with contextlib.suppress(ValueError):  # Closed.
            for line in self._process.stdout:
                with contextlib.suppress(queue.Full):
                    self._events.put_nowait(json.loads(line))

    def events(self) -> list[dict[str, Any]]:
        """Returns the events since the last call."""
        events = []
        with contextlib.suppress(queue.Empty):
            while True:
                events.append(self._events.get_nowait())
        return events

    def wait(self, seconds: float) -> bool:
        """Waits for an event and removes it; returns whether there was one."""
        with contextlib.suppress(queue.Empty):
            self._events.get(timeout=seconds)
            return True
        return False

    @property
    def is_closed(self) -> bool:
        """True after the process has ended by `close`."""
        return self._process.returncode is not None

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    def close(self) -> None:
        """Ends the process; may be called twice."""
        if self.is_closed:
            return
        assert self._process.stdin is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.close()
        try:
            self._process.wait(_END_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()
