"""Signals to a program, and the end of the one that started it."""

import contextlib
import os
import signal
import threading
from collections.abc import Iterator
from multiprocessing.process import parent_process


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Lets Ctrl-C and SIGTERM wait until the block has ended."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with_parent() -> None:
    """Ends this process, one of `multiprocessing`, as soon as the one that started it has ended.

    One that is killed cannot end its workers, which would go on, or wait for work for ever.
    """
    parent = parent_process()
    if parent is not None:

        def watch() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=watch, name="parent watch", daemon=True).start()
