"""Signals to a program, and the end of its parent process."""

import asyncio
import contextlib
import os
import signal
import threading
from collections.abc import Coroutine, Iterator
from multiprocessing.process import parent_process
from typing import Any, TypeVar

Result = TypeVar("Result")


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Defers Ctrl-C and SIGTERM until the block has ended."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def run_async(work: Coroutine[Any, Any, Result]) -> Result:
    """Runs a coroutine as `asyncio.run` does; Ctrl-C and SIGTERM cancel it.

    An exception raised by a handler inside asyncio's own code would leave its loop half built, and
    print many lines. A coroutine may handle the signals itself.

    Raises:
        KeyboardInterrupt: A signal came, and the coroutine has been cancelled.
    """
    numbers, task, came = (signal.SIGINT, signal.SIGTERM), None, False

    async def whole() -> Result:
        nonlocal task
        task = asyncio.current_task()
        return await work

    def cancel() -> None:
        nonlocal came
        came = True
        if task is not None:
            task.cancel()

    with undisturbed():
        before = {number: signal.getsignal(number) for number in numbers}
        runner = asyncio.Runner()
        for number in numbers:
            runner.get_loop().add_signal_handler(number, cancel)
    try:
        return runner.run(whole())
    except asyncio.CancelledError:
        if came:
            raise KeyboardInterrupt from None
        raise
    finally:
        with undisturbed():
            runner.close()
            for number, handler in before.items():
                signal.signal(number, handler)


def end_with_parent() -> None:
    """Ends this `multiprocessing` process as soon as its parent has ended.

    A killed parent cannot end its workers, which would go on, or wait for work for ever.
    """
    parent = parent_process()
    if parent is not None:

        def watch() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=watch, name="parent watch", daemon=True).start()
