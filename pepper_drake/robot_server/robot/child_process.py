"""A process of our own that ends with the `with` statement of whoever started it."""

import multiprocessing
from abc import ABC, abstractmethod
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self


class ChildProcess(ABC):
    """One process, started anew and not forked: a fork would share threads and memory with us."""

    def start(self, target: Callable[..., None], arguments: tuple[Any, ...], name: str) -> None:
        """Starts it.

        Args:
            target: What it runs.
            arguments: Given to `target`; they are pickled.
            name: For whoever looks at the machine's processes.
        """
        self._process = multiprocessing.get_context("spawn").Process(
            target=target, args=arguments, name=name, daemon=True
        )
        self._process.start()

    def end(self, seconds: float) -> None:
        """Waits for its end; one that takes longer is killed [s]."""
        self._process.join(seconds)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()

    @abstractmethod
    def close(self) -> None:
        """Asks it to end, ends it, and lets go of what is shared with it."""

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
