"""A child process that ends with a `with` statement."""

import multiprocessing
from abc import ABC, abstractmethod
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self


class ChildProcess(ABC):
    """One process, spawned and not forked: a fork would share threads and memory."""

    def start(self, target: Callable[..., None], arguments: tuple[Any, ...], name: str) -> None:
        """Starts it.

        Args:
            target: Function that it runs.
            arguments: Given to `target`; they are pickled.
            name: In the list of processes.
        """
        self._process = multiprocessing.get_context("spawn").Process(
            target=target, args=arguments, name=name, daemon=True
        )
        self._process.start()

    def end(self, seconds: float) -> None:
        """Waits for its end, and kills it after a timeout [s]."""
        self._process.join(seconds)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    @abstractmethod
    def close(self) -> None:
        """Requests its end, ends it, and releases shared resources."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
