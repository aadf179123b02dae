"""State, commands and images shared by two processes without a lock.

Each block has one writer. Counters before and after its content (a seqlock) tell a reader that
the content changed during its copy; it then copies again.
"""

import itertools
import time
from dataclasses import dataclass
from multiprocessing import shared_memory
from typing import Any

import numpy as np
import numpy.typing as npt

Record = npt.NDArray[np.void]

_SPINS = 20
"""Attempts before the reader waits for the writer."""
_PAUSE = 0.0002
_LONGEST_WRITE = 2.0
"""Timeout of an unfinished write [s]."""


class SharedRecord:
    """One record of a structured dtype in shared memory, with one writer."""

    def __init__(self, dtype: np.dtype[Any], name: str | None = None) -> None:
        """Creates the record, or opens an existing one.

        Args:
            dtype: Layout of the content.
            name: The creating process's `name`; None to create one.
        """
        self._dtype = np.dtype([("before", np.int64), ("content", dtype), ("after", np.int64)])
        self._memory = shared_memory.SharedMemory(name, name is None, self._dtype.itemsize)
        self._owner = name is None
        self._record = np.ndarray((), self._dtype, self._memory.buf)
        if name is None:
            self._record["before"] = self._record["after"] = 0

    @property
    def name(self) -> str:
        """Name for another process to open it."""
        return self._memory.name

    @property
    def writes(self) -> int:
        """Number of writes of the record."""
        return int(self._record["after"])

    def write(self, **fields: Any) -> None:
        """Writes some fields; the others keep their values."""
        number = int(self._record["after"]) + 1
        self._record["before"] = number
        for name, value in fields.items():
            self._record["content"][name] = value
        self._record["after"] = number

    def read_at_once(self) -> Record | None:
        """Returns a copy of the content without waiting, None while it is being written."""
        for _ in range(_SPINS):
            after = int(self._record["after"])
            content = self._record["content"].copy()
            if int(self._record["before"]) == after == int(self._record["after"]):
                return np.asarray(content)
        return None

    def read(self) -> Record:
        """Returns a consistent copy of the content.

        Raises:
            RuntimeError: The writer stopped in the middle of a write.
        """
        end = time.monotonic() + _LONGEST_WRITE
        for tries in itertools.count():
            after = int(self._record["after"])
            content = self._record["content"].copy()
            if int(self._record["before"]) == after == int(self._record["after"]):
                return np.asarray(content)
            if tries > _SPINS:
                # The writer was interrupted, and may need this processor to continue.
                if time.monotonic() > end:
                    break
                time.sleep(_PAUSE)
        raise RuntimeError("the other process stopped while it wrote")

    def close(self) -> None:
        """Releases the memory; its creator removes it."""
        del self._record
        self._memory.close()
        if self._owner:
            self._memory.unlink()


@dataclass(frozen=True)
class SharedNames:
    """Names of the records of one robot.

    Attributes:
        state: Written by the simulator.
        command: Written by the server.
        images: Written by the simulator, one for each camera.
    """

    state: str
    command: str
    images: tuple[str, ...]
